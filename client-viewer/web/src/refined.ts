// The surface refined near tools: smaller triangles in place of some of the keyframe's.
import { positionsOf } from "./particles";
import type { RefinedSurface } from "./wire";

export interface Patch {
  /** Triangles of the keyframe that are not drawn. */
  readonly replaced: Uint32Array;
  /** What is drawn instead: vertices of the keyframe, then the patch's own. */
  readonly triangles: Uint32Array;
  /** Of its own vertices, present (m), x y z per vertex. */
  readonly positions: Float32Array;
  /** Magnitude of the displacement (m) per vertex. */
  readonly displacement: Float32Array;
}

/** The patch on a keyframe of so many vertices and triangles. */
export function patchOf(refined: RefinedSurface, vertexCount: number, triangleCount: number): Patch {
  const replaced = indices(refined.replacedU32le);
  const triangles = indices(refined.trianglesU32le);
  const positions = refined.restPositions ? positionsOf(refined.restPositions) : new Float32Array();
  const own = positions.length / 3;
  const moved = refined.displacementsI16le;
  const fits = moved.byteLength === 6 * own && triangles.length % 3 === 0 && triangles.length >= 3 * replaced.length
    && replaced.every((triangle) => triangle < triangleCount) && triangles.every((vertex) => vertex < vertexCount + own);
  if (!fits) throw new Error("a refined surface whose arrays do not fit");
  const values = new DataView(moved.buffer, moved.byteOffset, moved.byteLength);
  const displacement = new Float32Array(own);
  for (let vertex = 0; vertex < own; vertex++) {
    const u = [0, 2, 4].map((at) => refined.displacementQuantumM * values.getInt16(6 * vertex + at, true));
    u.forEach((component, axis) => (positions[3 * vertex + axis]! += component));
    displacement[vertex] = Math.hypot(...u);
  }
  return { replaced, triangles, positions, displacement };
}

function indices(bytes: Uint8Array): Uint32Array {
  if (bytes.byteLength % 4 !== 0) throw new Error(`indices of ${bytes.byteLength} bytes are not made of 4 bytes each`);
  const values = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  return Uint32Array.from({ length: bytes.byteLength / 4 }, (_, i) => values.getUint32(4 * i, true));
}
