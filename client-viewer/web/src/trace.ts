// The samples of the force plot: the last ten seconds of simulated time, however fast or slow they pass.

/** Simulated time shown (s). */
export const SPAN_S = 10;
/** Samples closer than this (s) become one: bounds the memory at SPAN_S / SPACING_S samples. */
const SPACING_S = 0.005;

/** Magnitudes of forces (N) at a simulated time (s); `gap`: nothing is known of the time since the sample before. */
export interface Sample { time: number; contact: number; device: number; gap: boolean }

export class Trace {
  samples: Sample[] = [];
  private gap = true;

  push(time: number, contact: number, device: number): void {
    // Time runs backwards after a reset or in another scene: begin anew.
    if (time < (this.samples.at(-1)?.time ?? time)) this.clear();
    const before = this.samples.at(-2);
    const last = this.samples.at(-1);
    const gap = this.gap;
    this.gap = false;
    // While time stands, or crawls, the newest value takes the place of the last one.
    if (last && !gap && (time === last.time || (before && time - before.time < SPACING_S))) {
      this.samples[this.samples.length - 1] = { time, contact, device, gap: last.gap };
      return;
    }
    this.samples.push({ time, contact, device, gap });
    const old = this.samples.findIndex((sample) => sample.time > time - SPAN_S);
    if (old > 0) this.samples.splice(0, old);
  }

  /** The stream broke off: no line to the next sample. */
  interrupt(): void {
    this.gap = true;
  }

  clear(): void {
    this.samples = [];
    this.gap = true;
  }
}
