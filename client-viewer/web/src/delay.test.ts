import { expect, it } from "vitest";
import { delayText } from "./delay";

it("tells a delay from two clocks", () => {
  expect(delayText(12.4)).toBe("12 ms");
  expect(delayText(-1)).toBe("0 ms");
  expect(delayText(-5000)).toBe("clocks differ");
  expect(delayText(8e7)).toBe("clocks differ");
});
