import { expect, it } from "vitest";
import { tokenOf } from "./token";

it("takes a token from behind #token=", () => {
  const token = `palpate1.name=anna.role=viewer+injector.until=1798761600.${"0a".repeat(32)}`;
  expect(tokenOf(`#token=${token}`)).toBe(token);
});

it("takes none where the address has another form", () => {
  for (const hash of ["", "#", "#token=", "#token=abc", "#other=palpate1.x", "#token=palpate1.a b", "#token=palpate1.a\n"]) {
    expect(tokenOf(hash)).toBeNull();
  }
});
