// The delay of an update, for people.

/** Two clocks on one machine agree better than this (ms), however coarse the browser makes its own. */
const COARSE_MS = 20;

/** Age (ms) of a time stamp as text: an update from the future, or of an hour ago, tells of two clocks, not of a delay. */
export function delayText(ageMs: number): string {
  if (ageMs < -COARSE_MS || ageMs > 3_600_000) return "clocks differ";
  return `${Math.max(0, ageMs).toFixed(0)} ms`;
}
