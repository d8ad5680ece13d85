// The deformed surface as the stream tells it: keyframe chunks, then displacements of changed vertices in quanta.
import type { KeyframeChunk, KeyframeHeader, SurfaceUpdate } from "./wire";

export class Surface {
  readonly header: KeyframeHeader;
  readonly epoch: number;
  /** Rest positions (m), x y z per vertex. */
  readonly rest: Float32Array;
  /** Present positions (m). */
  readonly positions: Float32Array;
  /** Magnitude of the displacement (m) per vertex. */
  readonly displacement: Float32Array;
  readonly triangles: Uint32Array;

  constructor(header: KeyframeHeader, epoch: number, rest: Float32Array, triangles: Uint32Array) {
    this.header = header;
    this.epoch = epoch;
    this.rest = rest;
    this.positions = rest.slice();
    this.displacement = new Float32Array(rest.length / 3);
    this.triangles = triangles;
  }

  /** Applies an update of the same epoch; false when it belongs to another keyframe or does not fit. */
  apply(update: SurfaceUpdate): boolean {
    if (update.epoch !== this.epoch) return false;
    const values = littleEndian(update.displacementsI16le, 2);
    const count = update.displacementsI16le.byteLength / 6;
    const indices = update.changedU32le.byteLength > 0 ? littleEndian(update.changedU32le, 4) : undefined;
    if (indices ? update.changedU32le.byteLength / 4 !== count : count !== 0 && count !== this.displacement.length) return false;
    const quantum = update.displacementQuantumM;
    for (let i = 0; i < count; i++) {
      const vertex = indices ? indices.getUint32(4 * i, true) : i;
      if (vertex >= this.displacement.length) return false;
      let square = 0;
      for (let axis = 0; axis < 3; axis++) {
        const d = values.getInt16(6 * i + 2 * axis, true) * quantum;
        this.positions[3 * vertex + axis] = (this.rest[3 * vertex + axis] ?? 0) + d;
        square += d * d;
      }
      this.displacement[vertex] = Math.sqrt(square);
    }
    return true;
  }
}

/** Collects the chunks of a keyframe; gives the surface when the last one has come. */
export class KeyframeAssembler {
  private chunks: KeyframeChunk[] = [];

  push(chunk: KeyframeChunk): Surface | undefined {
    if (chunk.chunk === 0) this.chunks = [];
    if (chunk.chunk !== this.chunks.length || (this.chunks[0]?.epoch ?? chunk.epoch) !== chunk.epoch) {
      this.chunks = [];
      throw new Error(`keyframe chunk ${chunk.chunk} of epoch ${chunk.epoch} came out of order`);
    }
    this.chunks.push(chunk);
    if (this.chunks.length < chunk.chunkCount) return undefined;
    const header = this.chunks[0]?.header;
    if (!header) throw new Error("the keyframe has no header");
    const rest = new Float32Array(joined(this.chunks.map((c) => c.restPositionsMF32le)).buffer);
    const triangles = new Uint32Array(joined(this.chunks.map((c) => c.trianglesU32le)).buffer);
    if (rest.length !== 3 * header.vertexCount || triangles.length !== 3 * header.triangleCount) {
      throw new Error(`the keyframe announces ${header.vertexCount} vertices and brings ${rest.length / 3}`);
    }
    if (triangles.some((vertex) => vertex >= header.vertexCount)) throw new Error("the keyframe has triangles of vertices that it does not bring");
    this.chunks = [];
    return new Surface(header, chunk.epoch, rest, triangles);
  }
}

function littleEndian(bytes: Uint8Array, size: number): DataView {
  if (bytes.byteLength % size !== 0) throw new Error(`array of ${bytes.byteLength} bytes is not made of ${size}-byte values`);
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

// Typed arrays read in the machine's order; browsers run on little-endian machines only.
function joined(parts: Uint8Array[]): Uint8Array<ArrayBuffer> {
  const whole = new Uint8Array(parts.reduce((sum, part) => sum + part.byteLength, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.byteLength;
  }
  return whole;
}
