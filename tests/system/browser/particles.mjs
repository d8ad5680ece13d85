// Drives the layer of active particles in headless Chromium, with a hybrid body pressed and with a body of tets.
// Usage: node particles.mjs PALPATED SCENE ARTEFACTS [CHROMIUM]
// Each check prints a line; the first that fails ends the run with exit code 1.
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { setTimeout as sleep } from "node:timers/promises";
import { PNG } from "pngjs";
import { check, complaintsOf, freePort, launch, session, startDaemon, stopDaemon } from "./common.mjs";

const [palpated, scene, artefacts, executablePath = "/usr/bin/chromium"] = process.argv.slice(2);
mkdirSync(artefacts, { recursive: true });
const port = await freePort();
const url = `http://127.0.0.1:${port}/`;

const label = async (page) => (await page.textContent("#particle-layer")).trim();
const live = (page) => page.waitForSelector('#connection[data-state="live"]', { timeout: 20_000 });

/** Pixels of the particles' yellowish green, which nothing else on the page has. */
async function greenish(page, name) {
  await sleep(500);
  const shot = PNG.sync.read(await page.screenshot({ path: join(artefacts, name) }));
  const view = await page.locator("#view").boundingBox();
  let count = 0;
  for (let y = Math.ceil(view.y); y < view.y + view.height - 1; y++) {
    for (let x = Math.ceil(view.x); x < view.x + view.width - 1; x++) {
      const [r, g, b] = shot.data.subarray(4 * (y * shot.width + x));
      if (g > r && g - b > 40) count++;
    }
  }
  return count;
}

/** Waits until the page tells how many particles there are. */
async function counted(page) {
  for (let i = 0; i < 100 && !/: \d+$/.test((await label(page))); i++) await sleep(50);
  return Number(/: (\d+)$/.exec((await label(page)))?.[1]);
}

const browser = await launch(executablePath);
let daemon = await startDaemon(palpated, port, scene);
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 860 } });
  const noComplaints = complaintsOf(page);
  // Pressed, and there it stays: field 2 of Pause, true; field 2 of Step, 500 ticks.
  await session(url, "Pause", Buffer.from([0x10, 1]));
  await session(url, "Reset", Buffer.alloc(0));
  await session(url, "Step", Buffer.from([0x10, 0xf4, 0x03]));
  await page.goto(url);
  await live(page);
  await page.waitForFunction(() => document.querySelector("#time").textContent.startsWith("0.50"));
  const before = await greenish(page, "particles-off.png");
  check("the layer is off at first", !(await page.isChecked("#particles")) && (await label(page)) === "active particles");

  await page.check("#particles");
  const count = await counted(page);
  check("active particles are counted", count > 20 && count <= 600, await label(page));
  const on = await greenish(page, "particles-on.png");
  check("active particles are drawn", on > before + 500, `${before} pixels before, ${on} after`);
  check("asking anew loses nothing", (await page.getAttribute("#connection", "data-state")) === "live");
  await page.setViewportSize({ width: 720, height: 420 });
  await greenish(page, "particles-small.png");
  await page.setViewportSize({ width: 1280, height: 860 });

  await session(url, "Reset", Buffer.alloc(0));
  await page.waitForFunction(() => document.querySelector("#particle-count").textContent === ": 0");
  check("none are active at rest", (await greenish(page, "particles-rest.png")) < 50);
  await session(url, "Step", Buffer.from([0x10, 0xf4, 0x03]));
  await page.waitForFunction(() => /: [1-9]/.test(document.querySelector("#particle-count").textContent));
  await page.uncheck("#particles");
  check("off again, they go", (await greenish(page, "particles-off-again.png")) <= before + 50, await label(page));

  // The page stays open with the layer on, and the daemon comes back with a body that has none.
  await page.check("#particles");
  await stopDaemon(daemon);
  daemon = await startDaemon(palpated, port, "ventricle");
  await page.waitForFunction(() => document.querySelector("#scene-name").textContent === "ventricle", null, { timeout: 30_000 });
  check("a body of tets says that it has none", /none in this body/.test(await label(page)) && (await page.isDisabled("#particles")), await label(page));
  await greenish(page, "particles-none.png");
  noComplaints();
} finally {
  await browser.close();
  if (daemon.exitCode === null) await stopDaemon(daemon);
}
console.log("particles: all checks passed");
