import { describe, expect, it } from "vitest";
import { positionsOf } from "./particles";

const corner = { x: -0.5, y: 0, z: 0.25 };

describe("active particles", () => {
  it("are placed from the corner in quanta, aligned or not", () => {
    const padded = new Uint8Array(13);
    padded.set(new Uint8Array(new Uint16Array([0, 1, 2, 65535, 0, 4]).buffer), 1);
    const positions = positionsOf({ cornerM: corner, quantumM: 2 ** -16, positionsU16le: padded.subarray(1) });
    expect(Array.from(positions)).toEqual([-0.5, 2 ** -16, 0.25 + 2 ** -15, 0.5 - 2 ** -16, 0, 0.25 + 2 ** -14]);
  });

  it("may be none, and are refused when cut short", () => {
    expect(positionsOf({ quantumM: 1, positionsU16le: new Uint8Array() })).toHaveLength(0);
    expect(() => positionsOf({ cornerM: corner, quantumM: 1, positionsU16le: new Uint8Array(8) })).toThrow(/8 bytes/);
  });
});
