// Active particles, or other points of an update: 16-bit places in the box that holds them.
import type { Places } from "./wire";

/** Positions (m), x y z per point. */
export function positionsOf({ cornerM, quantumM, positionsU16le: bytes }: Places): Float32Array {
  if (bytes.byteLength % 6 !== 0) throw new Error(`places of ${bytes.byteLength} bytes are not made of 6 bytes each`);
  const values = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const corner = [cornerM?.x ?? 0, cornerM?.y ?? 0, cornerM?.z ?? 0];
  return Float32Array.from({ length: bytes.byteLength / 2 }, (_, i) => corner[i % 3]! + quantumM * values.getUint16(2 * i, true));
}
