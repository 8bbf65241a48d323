// The one function of fzstd that the page uses.

/**
 * The contents of zstd frames, in `buf` if given, whose length must be theirs. Throws an Error for
 * invalid data.
 */
export function decompress(data: Uint8Array, buf?: Uint8Array): Uint8Array;
