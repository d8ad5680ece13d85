// Wires the stream to the view. One frame of the screen draws the newest update, however many came.
import { LegendRange, colourOf, niceCeiling } from "./colour";
import { watchForever } from "./connection";
import { ForcePlot } from "./plot";
import { Stage } from "./stage";
import { KeyframeAssembler, type Surface } from "./surface";
import type { SurfaceUpdate, Vec3 } from "./wire";

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const write = (id: string, text: string) => {
  const node = element(id);
  if (node.textContent !== text) node.textContent = text;
};
const magnitude = (v: Vec3 | undefined) => Math.hypot(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);

const stage = new Stage(element("view"));
const plot = new ForcePlot(element<HTMLCanvasElement>("plot-canvas"));
const legend = new LegendRange();
const assembler = new KeyframeAssembler();
let surface: Surface | undefined;
let newest: SurfaceUpdate | undefined;
let largestForce = 0.1;
const arrivals: number[] = [];

watchForever(
  (event) => {
    if (event.message.case === "keyframe") {
      const complete = assembler.push(event.message.value);
      if (complete) begin(complete);
    } else if (event.message.case === "update") {
      take(event.message.value);
    }
  },
  ({ state, text }) => {
    element("connection").dataset["state"] = state;
    write("connection", text);
  },
);

function begin(complete: Surface): void {
  surface = complete;
  newest = undefined;
  largestForce = 0.1;
  stage.show(complete);
  document.title = `${complete.header.sceneName} – Palpate`;
  write("scene-name", complete.header.sceneName);
  write("mesh", `${complete.header.vertexCount} vertices, ${complete.header.triangleCount} faces`);
}

function take(update: SurfaceUpdate): void {
  if (!surface || update.epoch !== surface.epoch) return;
  // Later updates build on this one: a stream that does not fit must begin anew.
  if (!surface.apply(update)) throw new Error(`update of tick ${update.tick} does not fit its keyframe`);
  newest = update;
  const tool = update.tools[0];
  const contact = magnitude(tool?.contactForceN);
  largestForce = Math.max(largestForce, contact);
  plot.push(update.timeS, contact, magnitude(tool?.deviceForceN));
  const now = performance.now();
  arrivals.push(now);
  while (arrivals.length > 0 && now - (arrivals[0] ?? now) > 2000) arrivals.shift();
}

function numbers(update: SurfaceUpdate): void {
  const tool = update.tools[0];
  write("time", `${update.timeS.toFixed(2)} s`);
  write("contact-force", tool ? `${magnitude(tool.contactForceN).toFixed(3)} N` : "no tool");
  write("device-force", tool ? `${magnitude(tool.deviceForceN).toFixed(3)} N` : "no tool");
  write("max-displacement", `${(1e3 * update.maxDisplacementM).toFixed(2)} mm`);
  write("tick-cost", `${update.tickCostUs.toFixed(0)} µs`);
  const first = arrivals[0];
  const span = first === undefined ? 0 : (arrivals[arrivals.length - 1]! - first) / 1000;
  write("rate", span > 0.2 ? `${((arrivals.length - 1) / span).toFixed(0)} Hz` : "–");
  write("delay", `${Math.max(0, Date.now() - Number(update.sentUnixNs / 1000n) / 1000).toFixed(0)} ms`);
  write("skipped", String(update.skipped));
}

function drawLegend(): void {
  const bar = element<HTMLCanvasElement>("legend-bar");
  const context = bar.getContext("2d");
  if (!context) return;
  for (let row = 0; row < bar.height; row++) {
    const [r, g, b] = colourOf(1 - row / (bar.height - 1));
    context.fillStyle = `rgb(${r * 255} ${g * 255} ${b * 255})`;
    context.fillRect(0, row, bar.width, 1);
  }
  const ticks = [1, 0.75, 0.5, 0.25, 0].map((fraction) => {
    const item = document.createElement("li");
    item.textContent = String(Number((fraction * legend.top * 1e3).toPrecision(3)));
    return item;
  });
  element("legend-ticks").replaceChildren(...ticks);
}

let drawn: SurfaceUpdate | undefined;
function frame(): void {
  if (newest && newest !== drawn) {
    drawn = newest;
    if (legend.update(newest.maxDisplacementM, performance.now())) drawLegend();
    stage.refresh(legend.top);
    stage.moveTools(newest.tools, niceCeiling(largestForce, 0.1));
    numbers(newest);
    plot.draw();
  }
  stage.render();
  requestAnimationFrame(frame);
}

element<HTMLInputElement>("wireframe").addEventListener("change", (e) => stage.setEdges((e.target as HTMLInputElement).checked));
element<HTMLInputElement>("ghost").addEventListener("change", (e) => stage.setGhost((e.target as HTMLInputElement).checked));
element("recentre").addEventListener("click", () => stage.recentre());
stage.setEdges(false);
stage.setGhost(false);
drawLegend();
requestAnimationFrame(frame);
