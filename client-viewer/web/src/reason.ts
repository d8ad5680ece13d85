// Why the stream is gone, for people.
import { ConnectError } from "@connectrpc/connect";

/** The daemon could not be reached. */
export class Unreachable extends Error {
  constructor(cause: unknown) {
    super("no daemon answers", { cause });
  }
}

/** True for an error that only a mistake in this page explains: a browser's own network errors never come here bare. */
export function isBug(error: unknown): error is Error {
  return error instanceof TypeError || error instanceof ReferenceError || error instanceof RangeError;
}

/** What to say of an error that ended the stream. */
export function reasonOf(error: unknown): string {
  if (isBug(error)) return `this page made a mistake (${error.message})`;
  // A browser calls every failure of the network a TypeError, in words of its own; the transport wraps it.
  if (error instanceof ConnectError) return error.cause instanceof TypeError ? "the connection broke" : error.rawMessage;
  return error instanceof Error ? error.message : String(error);
}
