// The stream of the surface, with reconnection: whatever happens, the page comes back by itself.
import { createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { isBug, reasonOf } from "./reason";
import { fetchSurfaceService, type SurfaceEvent } from "./wire";

export type ConnectionState = { state: "connecting" | "live" | "lost"; text: string };

const FIRST_PAUSE_MS = 250;
const LONGEST_PAUSE_MS = 5000;
/** A stream that says nothing for so long is taken for dead: the daemon sends tool states even when nothing moves. */
const SILENCE_MS = 5000;

export function watchForever(onEvent: (event: SurfaceEvent) => void, onState: (state: ConnectionState) => void): void {
  void loop(onEvent, onState);
}

async function loop(onEvent: (event: SurfaceEvent) => void, onState: (state: ConnectionState) => void): Promise<void> {
  let pauseMs = FIRST_PAUSE_MS;
  for (;;) {
    onState({ state: "connecting", text: "connecting" });
    let reason = "the daemon ended the stream";
    try {
      await watchOnce(onEvent, () => {
        pauseMs = FIRST_PAUSE_MS;
        onState({ state: "live", text: "live" });
      });
    } catch (error) {
      reason = reasonOf(error);
      if (isBug(error)) console.error(error);
      else console.info(error);
    }
    onState({ state: "lost", text: `lost: ${reason} – trying again in ${pauseMs / 1000} s` });
    await new Promise((resolve) => setTimeout(resolve, pauseMs));
    pauseMs = Math.min(2 * pauseMs, LONGEST_PAUSE_MS);
  }
}

async function watchOnce(onEvent: (event: SurfaceEvent) => void, onFirst: () => void): Promise<void> {
  const abort = new AbortController();
  const silence = new Error(`the daemon said nothing for ${SILENCE_MS / 1000} s`);
  let watchdog = window.setTimeout(() => abort.abort(silence), SILENCE_MS);
  try {
    const service = await fetchSurfaceService(abort.signal);
    const transport = createGrpcWebTransport({ baseUrl: new URL(".", window.location.href).href.replace(/\/$/, "") });
    const client = createClient(service, transport) as unknown as {
      watch(request: { maxRateHz: number }, options: { signal: AbortSignal }): AsyncIterable<SurfaceEvent>;
    };
    let first = true;
    for await (const event of client.watch({ maxRateHz: 60 }, { signal: abort.signal })) {
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
