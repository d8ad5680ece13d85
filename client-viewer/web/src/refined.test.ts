import { describe, expect, it } from "vitest";
import { patchOf } from "./refined";
import type { RefinedSurface } from "./wire";

const bytes = (numbers: Uint32Array | Uint16Array | Int16Array) => new Uint8Array(numbers.buffer);

/** Of four vertices and two triangles: the second is halved. */
const halved = (): RefinedSurface => ({
  replacedU32le: bytes(Uint32Array.of(1)),
  trianglesU32le: bytes(Uint32Array.of(1, 3, 4, 3, 2, 4)),
  restPositions: { cornerM: { x: 0.5, y: 0.5, z: 0 }, quantumM: 0.25, positionsU16le: bytes(Uint16Array.of(0, 0, 0)) },
  displacementQuantumM: 0.5,
  displacementsI16le: bytes(Int16Array.of(0, 4, -3)),
});

describe("a refined surface", () => {
  it("has small triangles in place of large ones, and vertices of its own", () => {
    const patch = patchOf(halved(), 4, 2);
    expect(Array.from(patch.replaced)).toEqual([1]);
    expect(Array.from(patch.triangles)).toEqual([1, 3, 4, 3, 2, 4]);
    expect(Array.from(patch.positions)).toEqual([0.5, 2.5, -1.5]);
    expect(Array.from(patch.displacement)).toEqual([2.5]);
  });

  it("may be none", () => {
    const none = new Uint8Array();
    const patch = patchOf({ replacedU32le: none, trianglesU32le: none, displacementQuantumM: 1, displacementsI16le: none }, 4, 2);
    expect(patch.triangles).toHaveLength(0);
  });

  it("is refused when its arrays do not fit", () => {
    expect(() => patchOf(halved(), 3, 2)).toThrow(/do not fit/);
    expect(() => patchOf(halved(), 4, 1)).toThrow(/do not fit/);
    expect(() => patchOf({ ...halved(), displacementsI16le: new Uint8Array(4) }, 4, 2)).toThrow(/do not fit/);
    expect(() => patchOf({ ...halved(), replacedU32le: new Uint8Array(3) }, 4, 2)).toThrow(/3 bytes/);
  });
});
