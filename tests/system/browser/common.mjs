// What the browser's tests share: a daemon of their own, a headless Chromium, checks.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createServer } from "node:net";
import { setTimeout as sleep } from "node:timers/promises";
import { chromium } from "playwright-core";

export async function freePort() {
  const server = createServer();
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const { port: free } = server.address();
  await new Promise((resolve) => server.close(resolve));
  return free;
}

/** `palpated serve` at a port, with the arguments given; resolves when it answers. */
export async function startDaemon(palpated, port, ...others) {
  const url = `${others.includes("--pki") ? "https" : "http"}://127.0.0.1:${port}/`;
  const child = spawn(palpated, ["serve", ...others, "--listen", `127.0.0.1:${port}`], { stdio: ["ignore", "pipe", "pipe"] });
  let output = "";
  for (const stream of [child.stdout, child.stderr]) stream.on("data", (data) => (output += data));
  for (let i = 0; i < 300; i++) {
    assert.equal(child.exitCode, null, `palpated ended:\n${output}`);
    try {
      if ((await fetch(url)).ok) return child;
    } catch {
      // not listening yet
    }
    await sleep(100);
  }
  child.kill("SIGKILL");
  throw new Error(`palpated does not answer at ${url}:\n${output}`);
}

export async function stopDaemon(child) {
  const ended = new Promise((resolve) => child.once("exit", (code) => resolve(code)));
  child.kill("SIGTERM");
  return ended;
}

export function check(what, ok, detail = "") {
  assert.ok(ok, `${what} ${detail}`);
  console.log(`ok  ${what} ${detail}`);
}

/** Waits until the page has been laid out and drawn as it is now, however long a busy machine takes: the observer of sizes is heard after a frame. */
export const drawn = (page) =>
  page.evaluate(async () => {
    for (let frames = 0; frames < 4; frames++) await new Promise((next) => requestAnimationFrame(next));
  });

/** Listens for errors of a page; what it returns checks that there were none but those of a connection that a test cut. */
export function complaintsOf(page) {
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  return () => {
    const serious = complaints.filter((text) => !/Failed to load resource|ERR_|network error|Failed to fetch/i.test(text));
    check("no error in the console but for the lost connection", serious.length === 0, serious.join("\n"));
  };
}

/** How many different colours a screenshot shows inside a box, and how many of its pixels are saturated. */
export function colours(png, x0, y0, x1, y1) {
  const seen = new Set();
  let saturated = 0;
  for (let y = y0; y < y1; y++) {
    for (let x = x0; x < x1; x++) {
      const at = 4 * (y * png.width + x);
      const [r, g, b] = png.data.subarray(at, at + 3);
      seen.add((r << 16) | (g << 8) | b);
      if (Math.max(r, g, b) - Math.min(r, g, b) > 40) saturated++;
    }
  }
  return { different: seen.size, saturated };
}

/** A call of Session over gRPC-Web with an encoded message. */
export async function session(url, method, message) {
  const frame = Buffer.concat([Buffer.from([0, 0, 0, 0, 0]), message]);
  frame.writeUInt32BE(message.length, 1);
  const headers = { "content-type": "application/grpc-web+proto" };
  const answer = await fetch(`${url}palpate.v1.Session/${method}`, { method: "POST", headers, body: frame });
  assert.ok(answer.ok && !answer.headers.has("grpc-message"), `${method}: ${answer.status} ${answer.headers.get("grpc-message")}`);
}

/** A headless browser that draws WebGL without a graphics card. */
export const launch = (executablePath, ...others) =>
  chromium.launch({
    executablePath,
    args: [
      ...others,
      "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
      "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    ],
  });
