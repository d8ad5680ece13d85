import { expect, it } from "vitest";
import { ScaleRange, colourOf, niceCeiling } from "./colour";

it("rounds up to 1, 2, 5", () => {
  expect(niceCeiling(0.00031, 1e-4)).toBeCloseTo(5e-4);
  expect(niceCeiling(0.002, 1e-4)).toBeCloseTo(2e-3);
  expect(niceCeiling(0, 1e-4)).toBe(1e-4);
  expect(niceCeiling(NaN, 1e-4)).toBe(1e-4);
});

it("gets darker with displacement", () => {
  const grey = (f: number) => { const [r, g, b] = colourOf(f); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  for (let i = 0; i < 20; i++) expect(grey((i + 1) / 20)).toBeLessThan(grey(i / 20));
});

it("grows at once and shrinks late", () => {
  const range = new ScaleRange(1e-4);
  expect(range.update(3e-3, 0)).toBe(true);
  expect(range.top).toBeCloseTo(5e-3);
  expect(range.update(1e-4, 3000)).toBe(false);
  expect(range.update(1e-4, 7000)).toBe(true);
  expect(range.top).toBeCloseTo(1e-4);
});

// It shrank to what it saw at that moment: a press every two seconds sent the scale down between two presses and up again in
// steps with the next one.
it("shrinks to the largest of the quiet time", () => {
  const range = new ScaleRange(1e-4);
  range.update(9e-3, 0);
  for (let ms = 100; ms <= 5900; ms += 100) range.update(1.5e-3 * Math.abs(Math.sin((Math.PI * ms) / 2000)), ms);
  expect(range.update(0, 6100)).toBe(true);
  expect(range.top).toBeCloseTo(2e-3);
  expect(range.update(1.5e-3, 6600)).toBe(false);
});
