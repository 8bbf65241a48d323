// Uploads a bundle; files that the daemon has are referenced by hash.
import { Problem, type Api } from "./api";
import { extensionOf, stemOf, type Bundle, type NamedFile } from "./files";
import type { Asset } from "./model";
import { bytesText, hexOf, t, T } from "./texts";

const BUNDLE_TYPE = "application/vnd.voxeld.bundle+json";
// Web Crypto takes a file as a whole. Larger ones are sent without asking.
const HASHED_BYTES_MAX = 256 << 20;

/** "sha256-…" of the bytes; null where the browser has no Web Crypto (plain HTTP, not loopback). */
async function assetId(blob: Blob): Promise<string | null> {
  if (!globalThis.crypto?.subtle || blob.size > HASHED_BYTES_MAX) return null;
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", await blob.arrayBuffer()));
  return "sha256-" + hexOf(digest);
}

async function knownAsset(api: Api, file: NamedFile, signal: AbortSignal): Promise<Asset | null> {
  const id = await assetId(file.blob);
  if (!id) return null;
  try {
    const asset = await api.json<Asset>(`/v1/assets/${id}?brief=1`, { signal });
    // Under the name of another format the bytes are another asset.
    return extensionOf(asset.filename) === extensionOf(file.name) ? asset : null;
  } catch (error) {
    if (error instanceof Problem && [404, 410].includes(error.status)) return null;
    throw error;
  }
}

/** The asset of one file or of several. Throws Problem, or AbortError of `signal`. */
export async function uploadBundle(
  api: Api,
  bundle: Bundle,
  onStep: (text: string, share: number, isKnown: boolean) => void, // share of the bytes, 0..1
  onAsset: (id: string) => void, // each, also of one file of several
  signal: AbortSignal,
): Promise<Asset> {
  const total = bundle.files.reduce((sum, file) => sum + file.blob.size, 0);
  let done = 0;
  const members: { name: string; asset: string }[] = [];
  let last: Asset | null = null;
  for (const file of bundle.files) {
    const { size } = file.blob;
    const step = (text: T, of = 0) => {
      const places = { name: file.name, done: bytesText(done + of), total: bytesText(total) };
      onStep(t(text, places), (done + of) / Math.max(1, total), text === T.knownFile);
    };
    step(T.hashing);
    last = await knownAsset(api, file, signal);
    if (last) {
      step(T.knownFile, size);
    } else {
      const path = `/v1/assets?filename=${encodeURIComponent(file.name.slice(file.name.lastIndexOf("/") + 1))}`;
      step(T.uploading);
      last = await api.upload<Asset>(
        path,
        file.blob,
        "application/octet-stream",
        sent => step(T.uploading, Math.min(sent, size)),
        signal,
      );
    }
    done += size;
    members.push({ name: file.name, asset: last.id });
    onAsset(last.id);
  }
  if (members.length === 1 && last) return last;
  const manifest = new Blob([JSON.stringify({ files: members })], { type: BUNDLE_TYPE });
  const path = `/v1/assets?filename=${encodeURIComponent(stemOf(bundle.mesh.name))}`;
  last = await api.upload<Asset>(path, manifest, BUNDLE_TYPE, () => undefined, signal);
  onAsset(last.id);
  return last;
}
