import { Code, ConnectError } from "@connectrpc/connect";
import { afterEach, expect, it, vi } from "vitest";
import { Unreachable, isBug, reasonOf } from "./reason";
import { fetchSurfaceService } from "./wire";

afterEach(() => vi.unstubAllGlobals());

// Every TypeError was called "no daemon answers": also one of the page itself.
it("tells a mistake of the page from a network that fails", () => {
  const mistake = new TypeError("x is undefined");
  expect(isBug(mistake)).toBe(true);
  expect(reasonOf(mistake)).toBe("this page made a mistake (x is undefined)");
  const broken = ConnectError.from(new TypeError("network error"));
  expect(isBug(broken)).toBe(false);
  expect(reasonOf(broken)).toBe("the connection broke");
  expect(reasonOf(new ConnectError("no such session", Code.NotFound))).toBe("no such session");
  expect(reasonOf(new Error("the update does not fit"))).toBe("the update does not fit");
});

it("calls a fetch that fails an unreachable daemon, and an abort what it is", async () => {
  vi.stubGlobal("fetch", () => Promise.reject(new TypeError("Failed to fetch")));
  const failed = await fetchSurfaceService(new AbortController().signal).catch((error: unknown) => error);
  expect(failed).toBeInstanceOf(Unreachable);
  expect(reasonOf(failed)).toBe("no daemon answers");
  vi.stubGlobal("fetch", () => Promise.resolve({ ok: true, arrayBuffer: () => Promise.reject(new TypeError("network error")) }));
  const cut = await fetchSurfaceService(new AbortController().signal).catch((error: unknown) => error);
  expect(cut).toBeInstanceOf(Unreachable);
  const silence = new Error("the daemon said nothing for 5 s");
  vi.stubGlobal("fetch", () => Promise.reject(silence));
  expect(await fetchSurfaceService(new AbortController().signal).catch((error: unknown) => error)).toBe(silence);
});
