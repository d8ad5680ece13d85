import { describe, expect, it } from "vitest";
import { KeyframeAssembler, Surface } from "./surface";
import type { KeyframeChunk, KeyframeHeader, SurfaceUpdate } from "./wire";

const header: KeyframeHeader = { sessionId: "s", sceneName: "t", vertexCount: 3, triangleCount: 1, tickPeriodS: 1e-3, tools: [], particleSpacingM: 0 };
const rest = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]);
const bytes = (array: ArrayBufferView) => new Uint8Array(array.buffer);
const chunk = (n: number, of: number, part: Partial<KeyframeChunk>): KeyframeChunk => ({
  epoch: 5, chunk: n, chunkCount: of, restPositionsMF32le: new Uint8Array(), trianglesU32le: new Uint8Array(), ...part,
});
const update = (part: Partial<SurfaceUpdate>): SurfaceUpdate => ({
  epoch: 5, tick: 1n, timeS: 0, sentUnixNs: 0n, skipped: 0n, displacementQuantumM: 0.001, changedU32le: new Uint8Array(),
  displacementsI16le: new Uint8Array(), tools: [], tickCostUs: 0, maxDisplacementM: 0, quarantine: "", ...part,
});

describe("keyframe", () => {
  it("is assembled from chunks split anywhere", () => {
    const assembler = new KeyframeAssembler();
    const all = bytes(rest);
    expect(assembler.push(chunk(0, 3, { header, restPositionsMF32le: all.slice(0, 7) }))).toBeUndefined();
    expect(assembler.push(chunk(1, 3, { restPositionsMF32le: all.slice(7) }))).toBeUndefined();
    const surface = assembler.push(chunk(2, 3, { trianglesU32le: bytes(new Uint32Array([0, 1, 2])) }));
    expect(Array.from(surface!.positions)).toEqual(Array.from(rest));
    expect(Array.from(surface!.triangles)).toEqual([0, 1, 2]);
  });

  it("refuses a gap and a wrong count", () => {
    const assembler = new KeyframeAssembler();
    expect(() => assembler.push(chunk(1, 2, {}))).toThrow(/out of order/);
    expect(() => assembler.push(chunk(0, 1, { header }))).toThrow(/announces 3/);
    const triangles = bytes(new Uint32Array([0, 1, 3]));
    expect(() => assembler.push(chunk(0, 1, { header, restPositionsMF32le: bytes(rest), trianglesU32le: triangles }))).toThrow(/does not bring/);
  });
});

describe("update", () => {
  const make = () => new Surface(header, 5, rest, new Uint32Array([0, 1, 2]));

  it("moves the named vertices only", () => {
    const surface = make();
    const ok = surface.apply(update({
      changedU32le: bytes(new Uint32Array([2])), displacementsI16le: bytes(new Int16Array([3, 0, -4])),
    }));
    expect(ok).toBe(true);
    expect(surface.positions[6]).toBeCloseTo(0.003, 6);
    expect(surface.positions[8]).toBeCloseTo(-0.004, 6);
    expect(surface.displacement[2]).toBeCloseTo(0.005, 6);
    expect(surface.displacement[0]).toBe(0);
  });

  it("reads arrays that are not aligned", () => {
    const surface = make();
    const padded = new Uint8Array(7);
    padded.set(bytes(new Int16Array([1, 1, 1])), 1);
    expect(surface.apply(update({ changedU32le: bytes(new Uint32Array([0])), displacementsI16le: padded.subarray(1) }))).toBe(true);
    expect(surface.positions[0]).toBeCloseTo(0.001, 6);
  });

  it("refuses another epoch, a vertex out of range and a wrong length", () => {
    const surface = make();
    expect(surface.apply(update({ epoch: 4 }))).toBe(false);
    expect(surface.apply(update({ changedU32le: bytes(new Uint32Array([9])), displacementsI16le: bytes(new Int16Array(3)) }))).toBe(false);
    expect(surface.apply(update({ displacementsI16le: bytes(new Int16Array(6)) }))).toBe(false);
  });
});
