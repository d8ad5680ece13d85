// Displacement to colour: light flesh at rest to violet, darker with every step (magma reversed), so that it keeps its order
// in grey and for colour-blind eyes, and shading stays visible where nothing moves.
const STOPS: readonly (readonly [number, number, number])[] = [
  [0.988, 0.922, 0.78], [0.996, 0.8, 0.6], [0.992, 0.655, 0.455], [0.965, 0.49, 0.37],
  [0.88, 0.345, 0.385], [0.73, 0.245, 0.45], [0.56, 0.18, 0.485], [0.39, 0.12, 0.48],
];

/** sRGB in 0..1 for a fraction; outside values take the end colours. */
export function colourOf(fraction: number): [number, number, number] {
  const at = Math.min(Math.max(fraction, 0), 1) * (STOPS.length - 1);
  const low = Math.min(Math.floor(at), STOPS.length - 2);
  const a = STOPS[low]!;
  const b = STOPS[low + 1]!;
  const t = at - low;
  return [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t];
}

/** The colours as stops of a CSS gradient. */
export function gradient(): string {
  return STOPS.map((stop) => `rgb(${stop.map((part) => 255 * part).join(" ")})`).join(", ");
}

/** The smallest of 1, 2, 5 × 10ⁿ that is not below `value`; `least` for nothing. */
export function niceCeiling(value: number, least: number): number {
  if (!(value > least)) return least;
  const power = 10 ** Math.floor(Math.log10(value));
  for (const factor of [1, 2, 5, 10]) if (factor * power >= value * (1 - 1e-9)) return factor * power;
  return 10 * power;
}

const QUIET_MS = 6000;

/** Upper end of a scale: grows at once, shrinks only when the values stayed small for a while, and then to the largest of them. */
export class ScaleRange {
  top: number;
  private quietSince: number | undefined;
  private largest = 0;

  /** `least` is the smallest upper end. */
  constructor(private readonly least: number) {
    this.top = least;
  }

  /** Takes a value; true when the upper end is another one. */
  update(value: number, nowMs: number): boolean {
    const wanted = niceCeiling(value, this.least);
    this.quietSince ??= nowMs;
    if (wanted >= this.top) return this.set(wanted, nowMs);
    this.largest = Math.max(this.largest, wanted);
    return nowMs - this.quietSince > QUIET_MS && this.set(this.largest, nowMs);
  }

  private set(top: number, nowMs: number): boolean {
    const differs = top !== this.top;
    this.top = top;
    this.largest = 0;
    this.quietSince = nowMs;
    return differs;
  }
}
