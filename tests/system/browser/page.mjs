// Drives the page in headless Chromium against a real daemon.
// Usage: node page.mjs PALPATED ARTEFACTS [CHROMIUM]
// Each check prints a line; the first that fails ends the run with exit code 1.
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { setTimeout as sleep } from "node:timers/promises";
import { PNG } from "pngjs";
import { check, colours, complaintsOf, drawn, freePort, launch, session, startDaemon, stopDaemon } from "./common.mjs";

const [palpated, artefacts, executablePath = "/usr/bin/chromium"] = process.argv.slice(2);
mkdirSync(artefacts, { recursive: true });

const port = await freePort();
const url = `http://127.0.0.1:${port}/`;

const number = async (page, id) => Number.parseFloat((await page.textContent(`#${id}`)).replace(",", ""));
const state = (page) => page.getAttribute("#connection", "data-state");

/** Field 2 true or false. */
const pause = (paused) => session(url, "Pause", Buffer.from([0x10, paused ? 1 : 0]));

/** 4096 forces (field 2) of 1000 N along x (fields 2, 1) on vertex 700 (field 1), far from the held base, for 3 ticks (field 4). */
function breakTheBody() {
  const x = Buffer.alloc(9, 0x09);
  x.writeDoubleLE(1000, 1);
  const force = Buffer.concat([Buffer.from([0x08, 0xbc, 0x05, 0x12, x.length]), x, Buffer.from([0x20, 3])]);
  return session(url, "InjectForces", Buffer.concat(Array(4096).fill(Buffer.concat([Buffer.from([0x12, force.length]), force]))));
}

/** Waits for a firm press and gives its force (N) and displacement (mm), read in one go: it lasts a second. */
async function press(page) {
  let [force, displacement] = [0, 0];
  for (let i = 0; i < 400 && !(force >= 0.02); i++) {
    [force, displacement] = await page.evaluate(() =>
      ["#contact-force", "#max-displacement"].map((part) => Number.parseFloat(document.querySelector(part).textContent)));
    await sleep(25);
  }
  return { force, displacement };
}

const browser = await launch(executablePath);
let daemon = await startDaemon(palpated, port);
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 860 } });
  const noComplaints = complaintsOf(page);
  await page.goto(url);
  await page.waitForSelector('#connection[data-state="live"]', { timeout: 20_000 });
  check("the page goes live", true);
  check("the scene has its name", (await page.textContent("#scene-name")) === "heart");
  check("the mesh is counted", /\d+ vertices, \d+ faces/.test(await page.textContent("#mesh")), await page.textContent("#mesh"));

  // The simulated arm presses every two seconds: wait for a firm press.
  const { force, displacement } = await press(page);
  const pressed = await page.screenshot({ path: join(artefacts, "page-pressed.png") });
  check("the arm presses", force >= 0.02, `${force} N`);
  check("the surface dents", displacement > 0.05, `${displacement} mm`);
  const shot = PNG.sync.read(pressed);
  const body = colours(shot, 250, 100, 1000, 640);
  check("the body is drawn in colours", body.different > 300 && body.saturated > 10_000, JSON.stringify(body));

  const ticks = await page.$$eval("#legend-ticks li", (items) => items.map((item) => Number(item.textContent)));
  check("the legend falls from top to 0", ticks.length === 5 && ticks[4] === 0 && ticks[0] > ticks[1], ticks.join(" "));
  // In one go: both are written in the same frame.
  const [top, largest] = await page.evaluate(() =>
    ["#legend-ticks li", "#max-displacement"].map((part) => Number.parseFloat(document.querySelector(part).textContent)));
  check("the legend reaches the largest displacement", top >= largest && top <= 20, `${top} mm of ${largest} mm`);
  const scale = await page.textContent("#arrow-scale");
  check("the arrow has a scale", /longest arrow (0\.[125]|[125]0?) N/.test(scale), scale);
  const caption = await page.textContent("#legend figcaption");
  check("the legend has a unit", caption.includes("mm"), caption);
  await sleep(1500);
  check("updates flow", (await number(page, "rate")) > 5, await page.textContent("#rate"));
  check("the delay is small", (await number(page, "delay")) < 1000, await page.textContent("#delay"));
  const before = await number(page, "time");
  await sleep(500);
  check("simulated time goes on", (await number(page, "time")) > before);
  // The whole width, as the newest seconds are at its right; without the line of 0 N at the bottom.
  const canvas = PNG.sync.read(await page.locator("#plot-canvas").screenshot());
  const plot = colours(canvas, 60, 5, canvas.width, 95);
  check("the force is plotted", plot.saturated > 100, JSON.stringify(plot));

  await pause(true);
  await page.waitForFunction(() => document.querySelector("#time").textContent.endsWith("stands"));
  check("time that stands is told", true, await page.textContent("#time"));
  check("the stream goes on while time stands", (await state(page)) === "live");
  await pause(false);
  await page.waitForFunction(() => !document.querySelector("#time").textContent.includes("stands"));
  check("time that goes on is told", true, await page.textContent("#time"));

  await page.check("#wireframe");
  await page.check("#ghost");
  await sleep(300);
  await page.screenshot({ path: join(artefacts, "page-edges.png") });
  await page.click("#recentre");

  // The end of the body lay behind the plot, and the arrow behind the numbers, in windows of little height.
  for (const [width, height] of [[400, 760], [420, 800], [660, 900], [720, 420], [800, 457], [1920, 1080], [1280, 717]]) {
    await page.setViewportSize({ width, height });
    await drawn(page);
    await press(page);
    const { body, tools, parts } = await page.evaluate(() => {
      const box = (part) => document.querySelector(part).getBoundingClientRect();
      const plain = ({ left, top, right, bottom }) => ({ left, top, right, bottom });
      return { ...stage.extent(), parts: ["header", "aside", "#legend", "#plot", "#view"].map(box).map(plain) };
    });
    await page.screenshot({ path: join(artefacts, `page-${width}x${height}.png`) });
    const apart = (a, b) => a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;
    const inside = (a, b) => a.left >= b.left && a.top >= b.top && a.right <= b.right && a.bottom <= b.bottom;
    const whole = { left: 0, top: 0, right: width, bottom: height };
    const free = parts.every((a, i) => inside(a, whole) && parts.slice(i + 1).every((b) => apart(a, b)));
    check(`all parts have room in ${width}x${height}`, free, free ? "" : JSON.stringify(parts));
    const panels = parts.slice(0, 4);
    const seen = [body, tools].every((a) => inside(a, parts[4]) && panels.every((b) => apart(a, b)));
    check("body, tool and arrow are in sight", seen, seen ? "" : JSON.stringify({ body, tools, view: parts[4] }));
    const filled = Math.max((body.right - body.left) / (parts[4].right - parts[4].left), (body.bottom - body.top) / (parts[4].bottom - parts[4].top));
    check("the body fills its place", filled > 0.5, filled.toFixed(2));
  }

  await breakTheBody();
  await page.waitForSelector("#fault", { state: "visible", timeout: 10_000 });
  const fault = await page.textContent("#fault");
  await page.screenshot({ path: join(artefacts, "page-fault.png") });
  check("a quarantined body is told", /held.*tick \d+ was refused.*until Reset/.test(fault), fault);
  await session(url, "Reset", Buffer.alloc(0));
  await page.waitForSelector("#fault", { state: "hidden", timeout: 10_000 });
  check("the word goes with the quarantine", true);
  await page.setViewportSize({ width: 1280, height: 860 });
  // What is counted now is compared with what is there when the arm presses again.
  check("the arm presses after the reset", (await press(page)).force >= 0.02);
  // The arrow of a force is on the graphics card from the frame after the force's number.
  await drawn(page);
  const geometries = await page.evaluate(() => stage.geometries);

  const code = await stopDaemon(daemon);
  check("the daemon drains with an open page", code === 0, `exit code ${code}`);
  for (let i = 0; i < 100 && (await state(page)) === "live"; i++) await sleep(100);
  check("the page says that the stream is lost", (await state(page)) !== "live", await page.textContent("#connection"));
  const lost = PNG.sync.read(await page.screenshot({ path: join(artefacts, "page-lost.png") }));
  const past = colours(lost, 250, 100, 900, 640);
  check("a picture of the past is grey", past.saturated < body.saturated / 10, JSON.stringify(past));
  check("nothing of the past is called a delay or a rate", (await page.textContent("#delay")) + (await page.textContent("#rate")) === "––");
  daemon = await startDaemon(palpated, port);
  await page.waitForSelector('#connection[data-state="live"]', { timeout: 20_000 });
  check("the page comes back by itself", true);
  check("the arm presses again", (await press(page)).force >= 0.02);
  await drawn(page);
  const after = await page.evaluate(() => stage.geometries);
  check("the old surface has left the graphics card", after > 0 && after === geometries, `${geometries} before, ${after} after`);

  noComplaints();
} finally {
  await browser.close();
  if (daemon.exitCode === null) await stopDaemon(daemon);
}
console.log("page: all checks passed");
