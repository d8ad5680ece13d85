import { describe, expect, it } from "vitest";
import { creased } from "./creases";

/** A cube of 12 triangles. */
const cube = () => {
  const rest = Float32Array.from([0, 1, 2, 3, 4, 5, 6, 7].flatMap((v) => [v & 1, (v >> 1) & 1, v >> 2]));
  const quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  const triangles = Uint32Array.from(quads.flatMap(([a, b, c, d]) => [a!, b!, c!, a!, c!, d!]));
  return { rest, triangles };
};

describe("creases", () => {
  it("give a cube's corners a vertex for each face, and faces their own", () => {
    const { rest, triangles } = cube();
    const { triangles: drawn, source } = creased(rest, triangles);
    expect(source).toHaveLength(24);
    expect(Array.from(source.subarray(0, 8))).toEqual([0, 1, 2, 3, 4, 5, 6, 7]);
    expect(Array.from(drawn, (vertex) => source[vertex])).toEqual(Array.from(triangles));
    // The two triangles of a face share two drawn vertices; different faces share none.
    for (let face = 0; face < 6; face++) {
      const own = new Set(drawn.subarray(6 * face, 6 * face + 6));
      expect(own.size).toBe(4);
      expect(drawn.filter((vertex, corner) => Math.floor(corner / 6) !== face && own.has(vertex))).toHaveLength(0);
    }
  });

  it("leave a smooth surface as it is", () => {
    // A fan that rises by 17 degrees.
    const rest = Float32Array.from([0, 0, 0.3, 1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0]);
    const triangles = Uint32Array.from([0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1]);
    const { triangles: drawn, source } = creased(rest, triangles);
    expect(source).toHaveLength(5);
    expect(Array.from(drawn)).toEqual(Array.from(triangles));
  });
});
