// What the page shows of whoever opened it: a token that came with the address, behind #token=, where no server and no log sees it.

const KEY = "palpate-token";

/** The token of an address, if it has one: `#token=palpate1.name=…`. */
export function tokenOf(hash: string): string | null {
  const found = /^#token=(palpate1\.[\w.=+-]+)$/.exec(hash);
  return found === null ? null : found[1]!;
}

/** The token that this page was opened with, now or before in this tab. It is taken out of the address, which people copy. */
export function ownToken(): string | null {
  const given = tokenOf(window.location.hash);
  if (given === null) return window.sessionStorage.getItem(KEY);
  window.sessionStorage.setItem(KEY, given);
  window.history.replaceState(null, "", window.location.pathname + window.location.search);
  return given;
}
