import { expect, it } from "vitest";
import { SPAN_S, Trace } from "./trace";

it("keeps the history while time stands", () => {
  const trace = new Trace();
  for (let i = 0; i < 100; i++) trace.push(i / 60, 1, 1);
  for (let i = 0; i < 10_000; i++) trace.push(99 / 60, 2, 2);
  expect(trace.samples.length).toBe(100);
  expect(trace.samples.at(-1)?.contact).toBe(2);
});

it("covers the whole span when time crawls, in bounded memory", () => {
  const trace = new Trace();
  for (let i = 0; i < 60_000; i++) trace.push(i / 3000, 0, 0);
  expect(trace.samples.length).toBeLessThan(SPAN_S * 500);
  expect(trace.samples.at(-1)!.time - trace.samples[0]!.time).toBeGreaterThan(SPAN_S - 0.1);
});

it("begins anew when time runs backwards, and breaks the line where the stream broke", () => {
  const trace = new Trace();
  trace.push(5, 1, 1);
  trace.push(5.1, 1, 1);
  trace.interrupt();
  trace.push(8, 1, 1);
  expect(trace.samples.map((s) => s.gap)).toEqual([true, false, true]);
  trace.push(0.1, 1, 1);
  expect(trace.samples.length).toBe(1);
});
