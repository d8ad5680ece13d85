// The messages of palpate.v1 that the page reads. The descriptor set comes from the daemon, so that page and daemon
// never disagree about the wire; these interfaces only give the fields their types.
import { createFileRegistry, fromBinary, type DescService } from "@bufbuild/protobuf";
import { FileDescriptorSetSchema } from "@bufbuild/protobuf/wkt";
import { Unreachable } from "./reason";

export interface Vec3 { x: number; y: number; z: number }

export interface Quaternion { w: number; x: number; y: number; z: number }

export interface KeyframeHeader {
  sessionId: string;
  sceneName: string;
  vertexCount: number;
  triangleCount: number;
  tickPeriodS: number;
  boundsMinM?: Vec3;
  boundsMaxM?: Vec3;
  /** Half length 0: a sphere; else a capsule along its own z. */
  tools: { name: string; radiusM: number; halfLengthM: number }[];
  /** 0: the body has no particles. */
  particleSpacingM: number;
}

export interface KeyframeChunk {
  epoch: number;
  chunk: number;
  chunkCount: number;
  header?: KeyframeHeader;
  restPositionsMF32le: Uint8Array;
  trianglesU32le: Uint8Array;
}

export interface ToolState {
  devicePositionM?: Vec3;
  proxyPositionM?: Vec3;
  contactForceN?: Vec3;
  deviceForceN?: Vec3;
  contacts: number;
  deviceOrientation?: Quaternion;
  proxyOrientation?: Quaternion;
}

export interface SurfaceUpdate {
  epoch: number;
  tick: bigint;
  timeS: number;
  sentUnixNs: bigint;
  skipped: bigint;
  displacementQuantumM: number;
  changedU32le: Uint8Array;
  displacementsI16le: Uint8Array;
  tools: ToolState[];
  tickCostUs: number;
  maxDisplacementM: number;
  quarantine: string;
  activeParticles?: Places;
  refinedSurface?: RefinedSurface;
}

export interface Places {
  cornerM?: Vec3;
  quantumM: number;
  positionsU16le: Uint8Array;
}

export interface RefinedSurface {
  replacedU32le: Uint8Array;
  trianglesU32le: Uint8Array;
  restPositions?: Places;
  displacementQuantumM: number;
  displacementsI16le: Uint8Array;
}

/** What the page asks of `Watch`. */
export interface WatchRequest { maxRateHz: number; activeParticles: boolean; refinedSurface: boolean }

export interface SurfaceEvent {
  message: { case: "keyframe"; value: KeyframeChunk } | { case: "update"; value: SurfaceUpdate } | { case: undefined };
}

/** Where the daemon serves the descriptor set of its own wire types. */
export const DESCRIPTOR_PATH = "palpate.v1.binpb";

export async function fetchSurfaceService(signal: AbortSignal): Promise<DescService> {
  // A browser calls a failure of the network a TypeError, at the answer's head and in its body alike.
  const unreachable = (error: unknown): never => {
    throw error instanceof TypeError ? new Unreachable(error) : error;
  };
  const answer = await fetch(DESCRIPTOR_PATH, { signal, cache: "no-cache" }).catch(unreachable);
  if (!answer.ok) throw new Error(`${DESCRIPTOR_PATH}: ${answer.status} ${answer.statusText}`);
  const bytes = new Uint8Array(await answer.arrayBuffer().catch(unreachable));
  const service = createFileRegistry(fromBinary(FileDescriptorSetSchema, bytes)).getService("palpate.v1.Surface");
  if (!service) throw new Error("the daemon's descriptor set has no palpate.v1.Surface");
  return service;
}
