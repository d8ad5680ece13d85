// Force over time, the last ten seconds.
import { niceCeiling } from "./colour";

const SPAN_S = 10;
const CAPACITY = 60 * SPAN_S * 2;

interface Sample { time: number; contact: number; device: number }

export class ForcePlot {
  private samples: Sample[] = [];
  private readonly canvas: HTMLCanvasElement;

  constructor(canvas: HTMLCanvasElement) {
    this.canvas = canvas;
  }

  push(time: number, contact: number, device: number): void {
    const last = this.samples[this.samples.length - 1];
    // Time runs backwards after a reset or another scene: begin anew.
    if (last && time < last.time) this.samples = [];
    this.samples.push({ time, contact, device });
    if (this.samples.length > CAPACITY) this.samples.splice(0, this.samples.length - CAPACITY);
  }

  draw(): void {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    if (this.canvas.width !== Math.round(width * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const context = this.canvas.getContext("2d");
    const last = this.samples[this.samples.length - 1];
    if (!context || !last) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const shown = this.samples.filter((sample) => sample.time > last.time - SPAN_S);
    const top = niceCeiling(Math.max(...shown.map((s) => Math.max(s.contact, s.device))), 0.1);
    const left = 44;
    const x = (time: number) => left + ((time - last.time + SPAN_S) / SPAN_S) * (width - left - 4);
    const y = (force: number) => 6 + (1 - force / top) * (height - 14);
    const style = getComputedStyle(document.documentElement);
    context.font = "11px ui-sans-serif, system-ui, sans-serif";
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const fraction of [0, 0.5, 1]) {
      const level = y(fraction * top);
      context.strokeStyle = style.getPropertyValue("--line");
      context.beginPath();
      context.moveTo(left, level);
      context.lineTo(width - 4, level);
      context.stroke();
      context.fillStyle = style.getPropertyValue("--quiet");
      context.fillText(`${Number((fraction * top).toPrecision(3))} N`, left - 8, level);
    }
    this.line(context, shown, (s) => s.device, x, y, style.getPropertyValue("--device"));
    this.line(context, shown, (s) => s.contact, x, y, style.getPropertyValue("--contact"));
  }

  private line(
    context: CanvasRenderingContext2D, samples: Sample[], value: (s: Sample) => number,
    x: (t: number) => number, y: (f: number) => number, colour: string,
  ): void {
    context.strokeStyle = colour;
    context.lineWidth = 1.5;
    context.beginPath();
    samples.forEach((s, i) => (i ? context.lineTo(x(s.time), y(value(s))) : context.moveTo(x(s.time), y(value(s)))));
    context.stroke();
    context.lineWidth = 1;
  }
}
