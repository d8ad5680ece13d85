// Pages of others in a real browser: none of them may pause the daemon, read from it, or show its page.
// Usage: node strangers.mjs PALPATED ARTEFACTS [CHROMIUM]
import { createServer } from "node:http";
import { check, freePort, launch, startDaemon, stopDaemon } from "./common.mjs";

const [palpated, , executablePath = "/usr/bin/chromium"] = process.argv.slice(2);
const [port, othersPort] = [await freePort(), await freePort()];
const url = `http://127.0.0.1:${port}/`;
const others = createServer((_, answer) => answer.writeHead(200, { "content-type": "text/html" }).end(`<iframe src="${url}"></iframe>`));
await new Promise((resolve) => others.listen(othersPort, "127.0.0.1", resolve));

/** What Pause answers a call from a page: an HTTP status, or the browser's refusal to tell. */
const pauseFrom = (page, target, mode, kind) =>
  page.evaluate(
    async ([target, mode, kind]) => {
      // Field 2, true, behind its prefix.
      const body = new Blob([new Uint8Array([0, 0, 0, 0, 2, 0x10, 1])], { type: kind });
      try {
        const answer = await fetch(`${target}palpate.v1.Session/Pause`, { method: "POST", mode, body });
        return `${answer.status} ${answer.type} ${answer.headers.get("grpc-status") ?? ""}`;
      } catch (error) {
        return `refused: ${error.message}`;
      }
    },
    [target, mode, kind],
  );

const browser = await launch(executablePath, "--host-resolver-rules=MAP evil.example 127.0.0.1");
const daemon = await startDaemon(palpated, port);
try {
  const own = await browser.newPage();
  await own.goto(url);
  await own.waitForSelector('#connection[data-state="live"]', { timeout: 20_000 });
  // A page behind another draws nothing; and what was asked for may take a moment.
  const comesToBe = async (said, was) => {
    await own.bringToFront();
    return own.waitForFunction(said, was, { timeout: 20_000 }).then(() => true, () => false);
  };
  /** The body's time goes on by a second. */
  const goesOn = async () => {
    await own.bringToFront();
    await own.waitForTimeout(500);
    return comesToBe((was) => parseFloat(document.querySelector("#time").textContent) > was + 1, parseFloat(await own.textContent("#time")));
  };
  const stands = () => comesToBe(() => document.querySelector("#time").textContent.includes("stands"));

  const page = await browser.newPage();
  await page.goto(`http://127.0.0.1:${othersPort}/`);
  for (const [mode, kind] of [
    ["no-cors", "text/plain"], ["no-cors", "application/grpc-web+proto"], ["cors", "application/grpc-web+proto"], ["no-cors", ""],
  ]) {
    const answer = await pauseFrom(page, url, mode, kind);
    check(`another origin is told nothing (${mode}, ${kind || "no type"})`, answer.startsWith("refused") || answer.startsWith("0 opaque"), answer);
  }
  check("and pauses nothing", await goesOn());
  const framed = page.frames().find((frame) => frame !== page.mainFrame());
  check("the page is in no frame of others", (await framed.$("#view").catch(() => null)) === null, framed.url());

  // A name of theirs that has been led here.
  const answer = await page.goto(`http://evil.example:${port}/`);
  check("a foreign name is refused", answer.status() === 421, await answer.text());
  const rebound = await pauseFrom(page, `http://evil.example:${port}/`, "same-origin", "application/grpc-web+proto");
  check("and may not call", rebound.startsWith("421"), rebound);
  check("and pauses nothing", await goesOn());

  const allowed = await pauseFrom(own, url, "same-origin", "application/grpc-web+proto");
  check("the daemon's own page may pause", allowed.startsWith("200"), allowed);
  check("and does", await stands());
} finally {
  await browser.close();
  others.close();
  await stopDaemon(daemon);
}
console.log("strangers: all checks passed");
