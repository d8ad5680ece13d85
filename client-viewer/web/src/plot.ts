// Force over time, the last ten seconds.
import { niceCeiling } from "./colour";
import { SPAN_S, type Sample, type Trace } from "./trace";

export class ForcePlot {
  private readonly canvas: HTMLCanvasElement;

  constructor(canvas: HTMLCanvasElement, private readonly trace: Trace) {
    this.canvas = canvas;
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  draw(): void {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const context = this.canvas.getContext("2d");
    const shown = this.trace.samples;
    const last = shown.at(-1);
    if (!context || !last) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
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
    samples.forEach((s) => (!s.gap ? context.lineTo(x(s.time), y(value(s))) : context.moveTo(x(s.time), y(value(s)))));
    context.stroke();
    context.lineWidth = 1;
  }
}
