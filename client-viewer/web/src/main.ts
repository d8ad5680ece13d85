// Wires the stream to the view. One frame of the screen draws the newest update, however many came.
import { ScaleRange, gradient } from "./colour";
import { watchForever } from "./connection";
import { delayText } from "./delay";
import { positionsOf } from "./particles";
import { ForcePlot } from "./plot";
import { patchOf } from "./refined";
import { Stage } from "./stage";
import { KeyframeAssembler, type Surface } from "./surface";
import { Trace } from "./trace";
import type { SurfaceUpdate, Vec3 } from "./wire";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const write = (id: string, text: string) => {
  const node = element(id);
  if (node.textContent !== text) node.textContent = text;
};
const magnitude = (v: Vec3 | undefined) => Math.hypot(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);

const stage = makeStage();
const trace = new Trace();
const plot = new ForcePlot(element<HTMLCanvasElement>("plot-canvas"), trace);
/** Displacement (m) of the last colour. */
let legend = new ScaleRange(1e-4);
/** Force (N) of the longest arrow. */
let arrow = new ScaleRange(0.1);
const assembler = new KeyframeAssembler();
let surface: Surface | undefined;
let newest: SurfaceUpdate | undefined;
const STANDS_MS = 1000;
/** When simulated time last went on (ms of this page's clock). */
let movedAt = 0;
const arrivals: number[] = [];

const particlesBox = element<HTMLInputElement>("particles");
const refinedBox = element<HTMLInputElement>("refined");

const askAnew = watchForever({
  request: () => ({ maxRateHz: 60, activeParticles: particlesBox.checked, refinedSurface: refinedBox.checked }),
  onEvent: (event) => {
    if (event.message.case === "keyframe") {
      const complete = assembler.push(event.message.value);
      if (complete) begin(complete);
    } else if (event.message.case === "update") {
      take(event.message.value);
    }
  },
  onState: ({ state, text }) => {
    element("connection").dataset["state"] = state;
    write("connection", text);
    if (state === "live") return;
    // What is seen is the past: the style sheet greys it, and what would pretend to be measured now goes.
    trace.interrupt();
    arrivals.length = 0;
    for (const id of ["rate", "delay"]) write(id, "–");
    showFault("");
    layOutParticles();
  },
});

/** The stage; without WebGL the numbers and the plot go on. */
function makeStage(): Stage | undefined {
  try {
    return new Stage(element("view"));
  } catch (error) {
    write("view", "This browser gives no WebGL, so the surface is not drawn; the numbers are live.");
    console.warn(error);
    return undefined;
  }
}

function begin(complete: Surface): void {
  // Asked anew, the daemon tells what is known; the first update moves every vertex.
  if (surface?.header.sessionId === complete.header.sessionId && surface.epoch === complete.epoch) return;
  if (surface?.header.sessionId !== complete.header.sessionId) {
    trace.clear();
    legend = new ScaleRange(1e-4);
    arrow = new ScaleRange(0.1);
  }
  surface = complete;
  drawLegend();
  newest = undefined;
  stage?.show(complete);
  stage?.refresh(legend.top);
  layOutParticles();
  document.title = `${complete.header.sceneName} – Palpate`;
  write("scene-name", complete.header.sceneName);
  write("mesh", `${complete.header.vertexCount} vertices, ${complete.header.triangleCount} faces`);
}

function take(update: SurfaceUpdate): void {
  if (!surface || update.epoch !== surface.epoch) return;
  // Later updates build on this one: a stream that does not fit must begin anew.
  if (!surface.apply(update)) throw new Error(`update of tick ${update.tick} does not fit its keyframe`);
  const now = performance.now();
  if (update.timeS !== newest?.timeS) movedAt = now;
  newest = update;
  const tool = update.tools[0];
  const contact = magnitude(tool?.contactForceN);
  trace.push(update.timeS, contact, magnitude(tool?.deviceForceN));
  arrivals.push(now);
  while (arrivals.length > 0 && now - (arrivals[0] ?? now) > 2000) arrivals.shift();
}

function numbers(update: SurfaceUpdate): void {
  const tool = update.tools[0];
  // The numbers and the plot are of the first tool: with several, it is named.
  const name = update.tools.length > 1 ? `${surface?.header.tools[0]?.name ?? "first tool"}: ` : "";
  // Paused, or held after a fault: the stream lives, the body does not.
  write("time", `${update.timeS.toFixed(2)} s${performance.now() - movedAt > STANDS_MS ? ", stands" : ""}`);
  write("contact-force", tool ? `${name}${magnitude(tool.contactForceN).toFixed(3)} N` : "no tool");
  write("device-force", tool ? `${name}${magnitude(tool.deviceForceN).toFixed(3)} N` : "no tool");
  write("max-displacement", `${(1e3 * update.maxDisplacementM).toFixed(3)} mm`);
  write("tick-cost", `${update.tickCostUs.toFixed(0)} µs`);
  const first = arrivals[0];
  const span = first === undefined ? 0 : (arrivals[arrivals.length - 1]! - first) / 1000;
  write("rate", span > 0.2 ? `${((arrivals.length - 1) / span).toFixed(0)} Hz` : "–");
  write("delay", delayText(Date.now() - Number(update.sentUnixNs / 1000n) / 1000));
  write("skipped", String(update.skipped));
  showFault(update.quarantine);
}

function drawLegend(): void {
  const ticks = [1, 0.75, 0.5, 0.25, 0].map((fraction) => {
    const item = document.createElement("li");
    item.textContent = String(Number((fraction * legend.top * 1e3).toPrecision(3)));
    return item;
  });
  element("legend-ticks").replaceChildren(...ticks);
  element("key").hidden = (surface?.header.tools.length ?? 0) === 0;
  write("arrow-scale", `longest arrow ${Number(arrow.top.toPrecision(3))} N`);
}

/** A banner while the body's state is quarantined: a surface that stands would look like one at rest. */
function showFault(quarantine: string): void {
  element("fault").hidden = quarantine === "";
  write("fault-text", quarantine);
}

/** The layer of particles as the body allows and the box says; their count comes with the next update. */
function layOutParticles(): void {
  const none = surface?.header.particleSpacingM === 0;
  particlesBox.disabled = none;
  const on = particlesBox.checked && !none;
  stage?.setParticles(on);
  write("particle-count", none ? ": none in this body" : on ? ": –" : "");
}

function showParticles({ activeParticles }: SurfaceUpdate): void {
  if (!activeParticles || !surface || !particlesBox.checked) return;
  const positions = positionsOf(activeParticles);
  stage?.moveParticles(positions, surface.header.particleSpacingM);
  write("particle-count", `: ${positions.length / 3}`);
}

/** What the newest update refined; says when it was asked for and there is nothing to refine. */
function showRefined({ refinedSurface }: SurfaceUpdate): void {
  const on = refinedBox.checked;
  const asked = on && surface !== undefined && refinedSurface !== undefined;
  const patch = asked ? patchOf(refinedSurface, surface!.header.vertexCount, surface!.header.triangleCount) : undefined;
  stage?.setPatch(patch);
  write("refined-count", patch ? `: ${patch.triangles.length / 3} faces` : on ? ": –" : "");
}

let drawn: SurfaceUpdate | undefined;
function frame(): void {
  if (newest && newest !== drawn) {
    drawn = newest;
    const now = performance.now();
    const forces = newest.tools.map((tool) => magnitude(tool.contactForceN));
    const rescaled = arrow.update(Math.max(0, ...forces), now);
    if (legend.update(newest.maxDisplacementM, now) || rescaled) drawLegend();
    showRefined(newest);
    stage?.refresh(legend.top);
    stage?.moveTools(newest.tools, arrow.top);
    showParticles(newest);
    numbers(newest);
    plot.draw();
  }
  stage?.render();
  requestAnimationFrame(frame);
}

element<HTMLInputElement>("wireframe").addEventListener("change", (e) => stage?.setEdges((e.target as HTMLInputElement).checked));
element<HTMLInputElement>("ghost").addEventListener("change", (e) => stage?.setGhost((e.target as HTMLInputElement).checked));
particlesBox.addEventListener("change", () => {
  layOutParticles();
  askAnew();
});
refinedBox.addEventListener("change", () => {
  if (newest) drawn = undefined;
  askAnew();
});
element("recentre").addEventListener("click", () => stage?.recentre());
element("legend-bar").style.background = `linear-gradient(to top, ${gradient()})`;
// For the browser's tests, and for whoever looks under the page.
Object.assign(window, { stage });
stage?.setEdges(element<HTMLInputElement>("wireframe").checked);
stage?.setGhost(element<HTMLInputElement>("ghost").checked);
drawLegend();
requestAnimationFrame(frame);
