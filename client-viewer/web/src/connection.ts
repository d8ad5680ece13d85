// The stream of the surface, with reconnection: whatever happens, the page comes back by itself.
import { createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { isBug, reasonOf } from "./reason";
import { ownToken } from "./token";
import { fetchSurfaceService, type SurfaceEvent, type WatchRequest } from "./wire";

export type ConnectionState = { state: "connecting" | "live" | "lost"; text: string };

const FIRST_PAUSE_MS = 250;
const LONGEST_PAUSE_MS = 5000;
/** A stream that says nothing for so long is taken for dead: the daemon sends tool states even when nothing moves. */
const SILENCE_MS = 5000;

/** What is told of the stream, and what is asked of it. */
export interface Watching {
  request: () => WatchRequest;
  onEvent: (event: SurfaceEvent) => void;
  onState: (state: ConnectionState) => void;
}

/** Why a stream is left for another that asks for something else. */
const ANEW = new Error("asked anew");

/** Watches until the page goes; what it returns makes it ask anew, with what is wanted then. */
export function watchForever(watching: Watching): () => void {
  const stream = { abort: new AbortController() };
  void loop(watching, stream);
  return () => stream.abort.abort(ANEW);
}

async function loop({ request, onEvent, onState }: Watching, stream: { abort: AbortController }): Promise<void> {
  let pauseMs = FIRST_PAUSE_MS;
  for (;;) {
    // The picture stands for a moment while the page asks anew: nothing was lost.
    if (stream.abort.signal.reason !== ANEW) onState({ state: "connecting", text: "connecting" });
    stream.abort = new AbortController();
    let reason = "the daemon ended the stream";
    try {
      await watchOnce(request(), stream.abort, onEvent, () => {
        pauseMs = FIRST_PAUSE_MS;
        onState({ state: "live", text: "live" });
      });
    } catch (error) {
      if (stream.abort.signal.reason === ANEW) continue;
      reason = reasonOf(error);
      if (isBug(error)) console.error(error);
      else console.info(error);
    }
    onState({ state: "lost", text: `lost: ${reason} – trying again in ${pauseMs / 1000} s` });
    await new Promise((resolve) => setTimeout(resolve, pauseMs));
    pauseMs = Math.min(2 * pauseMs, LONGEST_PAUSE_MS);
  }
}

async function watchOnce(
  request: WatchRequest, abort: AbortController, onEvent: (event: SurfaceEvent) => void, onFirst: () => void,
): Promise<void> {
  const silence = new Error(`the daemon said nothing for ${SILENCE_MS / 1000} s`);
  let watchdog = window.setTimeout(() => abort.abort(silence), SILENCE_MS);
  try {
    const service = await fetchSurfaceService(abort.signal);
    const token = ownToken();
    const transport = createGrpcWebTransport({
      baseUrl: new URL(".", window.location.href).href.replace(/\/$/, ""),
      interceptors: token === null ? [] : [(next) => (call) => {
        call.header.set("authorization", `Bearer ${token}`);
        return next(call);
      }],
    });
    const client = createClient(service, transport) as unknown as {
      watch(request: WatchRequest, options: { signal: AbortSignal }): AsyncIterable<SurfaceEvent>;
    };
    let first = true;
    for await (const event of client.watch(request, { signal: abort.signal })) {
      if (first) onFirst();
      first = false;
      window.clearTimeout(watchdog);
      watchdog = window.setTimeout(() => abort.abort(silence), SILENCE_MS);
      onEvent(event);
    }
  } finally {
    window.clearTimeout(watchdog);
    abort.abort();
  }
}
