// Vertices on creases are drawn once for each side: with one normal for both an edge that is meant to be sharp looks gnawed at.

/** Turns at an edge (degrees) beyond this are meant. */
const SHARP_DEG = 50;

export interface Creased {
  /** Triangles of drawn vertices. */
  readonly triangles: Uint32Array;
  /** The surface's vertex of each drawn one; the first are the surface's own, in their order. */
  readonly source: Uint32Array;
}

/** A surface at rest (m, x y z per vertex), its creases cut open. */
export function creased(rest: Float32Array, triangles: Uint32Array): Creased {
  const vertices = rest.length / 3;
  const normals = normalsOf(rest, triangles);
  const at: number[][] = Array.from({ length: vertices }, () => []);
  triangles.forEach((vertex, corner) => at[vertex]!.push(corner));
  const least = Math.cos((SHARP_DEG * Math.PI) / 180);
  const isSmooth = (a: number, b: number) => [0, 1, 2].reduce((dot, k) => dot + normals[3 * a + k]! * normals[3 * b + k]!, 0) > least;
  const source = Array.from({ length: vertices }, (_, vertex) => vertex);
  const drawn = triangles.slice();
  for (const corners of at) {
    // Sides: triangles that hang together by edges at this vertex that are smooth.
    const left = new Set(corners);
    for (let side = 0; left.size > 0; side++) {
      const next = [left.values().next().value!];
      left.delete(next[0]!);
      const vertex = triangles[next[0]!]!;
      if (side > 0) source.push(vertex);
      for (let corner = next.pop(); corner !== undefined; corner = next.pop()) {
        if (side > 0) drawn[corner] = source.length - 1;
        const triangle = Math.floor(corner / 3);
        for (const other of left) {
          const across = Math.floor(other / 3);
          if (shareEdge(triangles, triangle, across) && isSmooth(triangle, across)) {
            left.delete(other);
            next.push(other);
          }
        }
      }
    }
  }
  return { triangles: drawn, source: Uint32Array.from(source) };
}

function shareEdge(triangles: Uint32Array, one: number, other: number): boolean {
  const corners = triangles.subarray(3 * one, 3 * one + 3);
  return triangles.subarray(3 * other, 3 * other + 3).filter((vertex) => corners.includes(vertex)).length >= 2;
}

function normalsOf(rest: Float32Array, triangles: Uint32Array): Float32Array {
  const normals = new Float32Array(triangles.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => rest.subarray(3 * triangles[t + k]!, 3 * triangles[t + k]! + 3)) as [Float32Array, Float32Array, Float32Array];
    const edge = (from: Float32Array, to: Float32Array) => [0, 1, 2].map((k) => to[k]! - from[k]!) as [number, number, number];
    const [p, q] = [edge(a, b), edge(a, c)];
    const n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    const length = Math.hypot(...n) || 1;
    n.forEach((component, k) => (normals[t + k] = component / length));
  }
  return normals;
}
