/** Malformed or unsupported bytes of a container; the message says where, expected and got. */
export class DecodeError extends Error {
  override readonly name = "DecodeError";
}

export function fail(detail: string, expected = "", got = ""): never {
  let text = detail;
  if (expected !== "") text += `: expected ${expected}`;
  if (got !== "") text += `${expected === "" ? ": " : ", "}got ${got}`;
  throw new DecodeError(text);
}
