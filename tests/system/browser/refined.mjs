// Drives the surface refined near tools in headless Chromium, with a hybrid body pressed and with a mass-spring surface.
// Usage: node refined.mjs PALPATED SCENE ARTEFACTS [CHROMIUM]
// Each check prints a line; the first that fails ends the run with exit code 1.
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { PNG } from "pngjs";
import { check, complaintsOf, drawn, freePort, launch, session, startDaemon, stopDaemon } from "./common.mjs";

const [palpated, scene, artefacts, executablePath = "/usr/bin/chromium"] = process.argv.slice(2);
mkdirSync(artefacts, { recursive: true });
const port = await freePort();
const url = `http://127.0.0.1:${port}/`;

const label = async (page) => (await page.textContent("#refined-layer")).trim();
const counted = (page, pattern) =>
  page.waitForFunction((text) => new RegExp(text).test(document.querySelector("#refined-count").textContent), pattern, { timeout: 20_000 });

const pressed = (page) =>
  page.waitForFunction(() => document.querySelector("#time").textContent.startsWith("0.50"), null, { timeout: 20_000 });

async function shot(page, name) {
  await drawn(page);
  return PNG.sync.read(await page.screenshot({ path: join(artefacts, name), clip: await page.locator("#view").boundingBox() }));
}

/** Pixels that differ by more than what compression and rounding leave. */
function different(one, other) {
  let count = 0;
  for (let at = 0; at < one.data.length; at += 4) if ([0, 1, 2].some((c) => Math.abs(one.data[at + c] - other.data[at + c]) > 8)) count++;
  return count;
}

/** Triangles that are drawn, and whether every edge of them has two: no gap. Creases are cut open: each side has vertices of its own. */
const surfaceOf = (page) => page.evaluate(() => {
  const { geometry, creased } = window.stage.skin;
  const vertexOf = (drawn) => creased.source[drawn] ?? drawn;
  const used = geometry.index.array.subarray(0, Math.min(geometry.drawRange.count, geometry.index.count));
  const edges = new Map();
  for (let t = 0; t < used.length; t += 3) {
    for (const [a, b] of [[0, 1], [1, 2], [2, 0]]) {
      const ends = [used[t + a], used[t + b]].map(vertexOf).sort((x, y) => x - y).join();
      edges.set(ends, (edges.get(ends) ?? 0) + 1);
    }
  }
  const normals = geometry.getAttribute("normal").array.subarray(0, 3 * (Math.max(...used) + 1));
  return { triangles: used.length / 3, closed: [...edges.values()].every((n) => n === 2), finite: normals.every(Number.isFinite) };
});

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
  await pressed(page);
  check("it is off at first", !(await page.isChecked("#refined")) && (await label(page)) === "smooth near tools");
  const plain = await surfaceOf(page);
  const before = await shot(page, "refined-off.png");

  await page.check("#refined");
  await counted(page, ": [1-9]\\d* faces");
  const smooth = await surfaceOf(page);
  check("small triangles are drawn near the tool", smooth.triangles > plain.triangles + 50, `${plain.triangles} before, ${smooth.triangles} after`);
  check("the surface is closed, with them and without", plain.closed && smooth.closed && smooth.finite, JSON.stringify([plain, smooth]));
  const after = await shot(page, "refined-on.png");
  check("the picture changes, near the tool only", different(before, after) > 20 && different(before, after) < 0.1 * before.width * before.height, `${different(before, after)} pixels`);
  const held = await page.evaluate(() => window.stage.geometries);

  // Away from the body nothing is refined, and touched again it is.
  for (let round = 0; round < 3; round++) {
    await session(url, "Reset", Buffer.alloc(0));
    await counted(page, ": 0 faces");
    check("no tool near, the surface is as it was", (await surfaceOf(page)).triangles === plain.triangles);
    await session(url, "Step", Buffer.from([0x10, 0xf4, 0x03]));
    // On the way there, other triangles are refined.
    await pressed(page);
    await counted(page, ": [1-9]\\d* faces");
  }
  check("the same is drawn again", (await surfaceOf(page)).triangles === smooth.triangles);
  check("the graphics card holds no more than before", (await page.evaluate(() => window.stage.geometries)) === held, `${held} geometries`);
  await page.uncheck("#refined");
  await counted(page, "^$");
  await page.waitForFunction((n) => window.stage.skin.geometry.drawRange.count === 3 * n, plain.triangles);
  check("off again, it is as before", different(before, await shot(page, "refined-off-again.png")) < 20);

  // The page stays open with it on, and the daemon comes back with a surface that is refined already.
  await page.check("#refined");
  await stopDaemon(daemon);
  daemon = await startDaemon(palpated, port, "springs-dome");
  await page.waitForFunction(() => document.querySelector("#scene-name").textContent === "springs-dome", null, { timeout: 30_000 });
  await counted(page, "^: –$");
  check("springs are drawn as they come", (await surfaceOf(page)).triangles > 100);
  noComplaints();
} finally {
  await browser.close();
  if (daemon.exitCode === null) await stopDaemon(daemon);
}
console.log("refined: all checks passed");
