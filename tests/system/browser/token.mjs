// The page of a daemon that wants to know who calls: nothing without a token, the surface with one from the address, which keeps none of it.
// Usage: node token.mjs PALPATED ARTEFACTS [CHROMIUM]
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { check, freePort, launch, startDaemon, stopDaemon } from "./common.mjs";

const [palpated, , executablePath = "/usr/bin/chromium"] = process.argv.slice(2);
// The authority of this test is nobody's.
process.env.NODE_TLS_REJECT_UNAUTHORIZED = "0";
const folder = mkdtempSync(join(tmpdir(), "palpate-token-"));
const keys = join(folder, "pki");
const pki = (...words) => execFileSync(palpated, ["pki", ...words, "--folder", keys], { encoding: "utf8" }).trim();
pki("init");
const viewers = pki("token", "wall-screen", "--role", "viewer");
const operators = pki("token", "anna", "--role", "operator");

const port = await freePort();
const url = `https://127.0.0.1:${port}/`;
const browser = await launch(executablePath, "--ignore-certificate-errors");
const daemon = await startDaemon(palpated, port, "--pki", keys);
try {
  /** A tab of its own, at an address; whether it comes to be live, and whether it may pause. */
  const open = async (address) => {
    const context = await browser.newContext({ ignoreHTTPSErrors: true });
    const page = await context.newPage();
    await page.goto(address);
    return page;
  };
  const isLive = (page, patienceMs) =>
    page.waitForSelector('#connection[data-state="live"]', { timeout: patienceMs }).then(() => true, () => false);

  const stranger = await open(url);
  check("without a token there is no surface", !(await isLive(stranger, 3000)), await stranger.textContent("#connection"));
  const wrong = await open(`${url}#token=${viewers.slice(0, -4)}AAAA`);
  check("nor with one that was tampered with", !(await isLive(wrong, 3000)), await wrong.textContent("#connection"));

  const viewer = await open(`${url}#token=${viewers}`);
  check("with a viewer's token there is", await isLive(viewer, 20_000));
  check("which the address does not keep", !viewer.url().includes("token"), viewer.url());
  await viewer.reload();
  check("and the tab does", await isLive(viewer, 20_000));
  // What the page's own code would call, with the token that the tab keeps.
  const pause = (page, token) =>
    page.evaluate(
      async ([target, token]) => {
        const body = new Uint8Array([0, 0, 0, 0, 2, 0x10, 1]);
        const headers = { "content-type": "application/grpc-web+proto", authorization: `Bearer ${token}` };
        const answer = await fetch(`${target}palpate.v1.Session/Pause`, { method: "POST", headers, body });
        return answer.headers.get("grpc-status") ?? "0";
      },
      [url, token],
    );
  check("a viewer may not pause", (await pause(viewer, viewers)) === "7");
  check("an operator may", (await pause(viewer, operators)) === "0");
} finally {
  await browser.close();
  await stopDaemon(daemon);
  rmSync(folder, { recursive: true });
}
console.log("token: all checks passed");
