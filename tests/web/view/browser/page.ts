// The page that tests drive: one canvas, one viewer, and functions that answer with plain data.
import { createViewer } from "../../../../client/web/view/create_viewer";
import type {
  Camera,
  Channel,
  GridInfo,
  Hit,
  Section,
  Style,
  Viewer,
} from "../../../../client/web/view/viewer";

export interface Settings {
  readonly camera?: Partial<Camera>;
  readonly style?: Style;
  readonly channel?: Channel | null;
  readonly section?: Section;
}

/** How two images of the same size differ, in steps of 255. */
export interface Difference {
  readonly mean: number; // over R, G and B of all pixels
  readonly meanAlpha: number;
  readonly largest: number;
  readonly drawn: number; // share of pixels that differ from the upper left one
}

const START: Camera = {
  azimuth: 30,
  elevation: 20,
  zoom: 1,
  pan: [0, 0],
  projection: "perspective",
};
const canvas = document.querySelector("canvas")!;
let viewer: Viewer | null = null;
const violations: string[] = [];
document.addEventListener("securitypolicyviolation", (event) =>
  violations.push(event.violatedDirective + " " + event.blockedURI),
);

function view(): Viewer {
  if (!viewer) throw new Error("no viewer");
  return viewer;
}

async function pixelsOf(blob: Blob): Promise<ImageData> {
  const bitmap = await createImageBitmap(blob, {
    premultiplyAlpha: "none",
    colorSpaceConversion: "none",
  });
  // WebGL keeps colours of transparent pixels; a 2D canvas would premultiply them.
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2")!,
    texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
  gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const image = new ImageData(bitmap.width, bitmap.height);
  gl.readPixels(0, 0, bitmap.width, bitmap.height, gl.RGBA, gl.UNSIGNED_BYTE, image.data);
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return image;
}

function difference(a: ImageData, b: ImageData): Difference {
  if (a.width !== b.width || a.height !== b.height)
    throw new Error(`${a.width}x${a.height} and ${b.width}x${b.height}`);
  let sum = 0,
    alpha = 0,
    largest = 0,
    drawn = 0;
  const pixels = a.width * a.height;
  for (let i = 0; i < 4 * pixels; i += 4) {
    let differs = false;
    for (let c = 0; c < 3; ++c) {
      const apart = Math.abs(a.data[i + c]! - b.data[i + c]!);
      sum += apart;
      largest = Math.max(largest, apart);
      differs ||= Math.abs(a.data[i + c]! - a.data[c]!) > 8;
    }
    alpha += Math.abs(a.data[i + 3]! - b.data[i + 3]!);
    drawn += differs ? 1 : 0;
  }
  return { mean: sum / (3 * pixels), meanAlpha: alpha / pixels, largest, drawn: drawn / pixels };
}

async function save(name: string, blob: Blob): Promise<void> {
  await fetch(`/save/${name}`, { method: "POST", body: blob });
}

const api = {
  open(width: number, height: number): boolean {
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    viewer = createViewer(canvas, "/decode_worker.js");
    return viewer !== null;
  },

  /** A hidden canvas is not drawn; images are. */
  hideCanvas(isHidden: boolean): void {
    canvas.hidden = isHidden;
  },

  renderer(): string {
    const gl = canvas.getContext("webgl2")!,
      info = gl.getExtension("WEBGL_debug_renderer_info");
    return String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  },

  async show(name: string, keepCamera = false): Promise<GridInfo> {
    const response = await fetch(`/data/${name}`);
    return view().show(await response.arrayBuffer(), { keepCamera });
  },

  async showPart(name: string | null): Promise<void> {
    await view().showPart(
      name === null ? null : await (await fetch(`/data/${name}`)).arrayBuffer(),
    );
  },

  showBuffer: (bytes: ArrayBuffer): Promise<GridInfo> => view().show(bytes),

  /** The error's name and text when a container is shown, or "". */
  async refusal(name: string, changeAt: number): Promise<string> {
    const bytes = new Uint8Array(await (await fetch(`/data/${name}`)).arrayBuffer());
    bytes[changeAt]! ^= 255;
    return view()
      .show(bytes.buffer)
      .then(
        () => "",
        (error: Error) => `${error.name}: ${error.message}`,
      );
  },

  /** Two grids at once: what became of each. */
  async showTwo(first: string, second: string): Promise<string[]> {
    const buffers = await Promise.all(
      [first, second].map(async (name) => (await fetch(`/data/${name}`)).arrayBuffer()),
    );
    const shown = buffers.map((buffer) =>
      view()
        .show(buffer)
        .then(
          (info) => info.dims.join(),
          (error: Error) => error.name,
        ),
    );
    return Promise.all(shown);
  },

  set(settings: Settings): void {
    const v = view();
    v.camera = { ...START, ...settings.camera };
    v.style = settings.style ?? "voxel";
    v.channel = settings.channel ?? null;
    v.section = settings.section ?? { plane: null, box: null };
  },

  /** Compares the viewer's image, asked for as soon as it is set, with a PNG of the daemon. */
  async compare(
    settings: Settings | null,
    png: string,
    width: number,
    height: number,
    transparent: boolean,
    name: string,
  ): Promise<Difference> {
    const response = await fetch(`/data/${png}`),
      expected = await response.blob();
    if (settings) api.set(settings);
    const own = await view().image(width, height, transparent);
    const found = difference(await pixelsOf(own), await pixelsOf(expected));
    await save(`${name}.page.png`, own);
    await save(`${name}.daemon.png`, expected);
    return found;
  },

  /** Compares an image with one during which another grid was shown. */
  async compareWhileShowing(name: string, width: number, height: number): Promise<Difference> {
    const alone = await pixelsOf(await view().image(width, height, false));
    let isDrawn = false;
    const image = view().image(width, height, false).finally(() => (isDrawn = true));
    await api.show(name);
    if (isDrawn) throw new Error("the image was drawn before the grid was shown");
    return difference(alone, await pixelsOf(await image));
  },

  /** Compares what is on the canvas at rest with image() of the canvas's size. */
  async compareCanvas(): Promise<Difference> {
    const onCanvas = await api.atRest();
    return difference(
      onCanvas,
      await pixelsOf(await view().image(canvas.width, canvas.height, false)),
    );
  },

  /** Waits for the next frame at rest and reads the canvas, as long as it holds it. */
  atRest(): Promise<ImageData> {
    return new Promise((resolve) => {
      const v = view();
      v.onFrame = (_, isAtRest) => {
        if (!isAtRest) return;
        v.onFrame = null;
        const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d")!;
        copy.drawImage(canvas, 0, 0);
        resolve(copy.getImageData(0, 0, canvas.width, canvas.height));
      };
      v.camera = v.camera;
    });
  },

  /** Milliseconds of frames while the camera turns, and of one at rest. */
  async frameTimes(turns: number): Promise<{ moving: number[]; rest: number }> {
    const v = view(),
      moving: number[] = [];
    let rest = 0;
    await new Promise<void>((resolve) => {
      v.onFrame = (ms, isAtRest) => {
        if (isAtRest) {
          rest = ms;
          return resolve();
        }
        moving.push(ms);
        if (moving.length < turns) v.camera = { ...v.camera, azimuth: v.camera.azimuth + 15 };
      };
      v.camera = { ...v.camera };
    });
    v.onFrame = null;
    return { moving, rest };
  },

  /** Frames that are drawn within so many milliseconds. */
  async frameCount(ms: number): Promise<number> {
    let count = 0;
    view().onFrame = () => ++count;
    await new Promise((resolve) => setTimeout(resolve, ms));
    return count;
  },

  async imageSize(width: number, height: number): Promise<string> {
    const blob = await view().image(width, height, false),
      bitmap = await createImageBitmap(blob);
    return `${bitmap.width}x${bitmap.height} ${blob.type}`;
  },

  /** Errors of two calls of a viewer whose worker is missing, and of one when it is there. */
  async refusalsWithoutWorker(): Promise<string[]> {
    const { Worker } = window;
    let isMissing = true;
    window.Worker = class extends Worker {
      constructor(url: string | URL, options?: WorkerOptions) {
        super(isMissing ? "/missing.js" : url, options);
      }
    };
    const other = createViewer(document.createElement("canvas"), "/decode_worker.js")!;
    const refusals: string[] = [];
    for (let i = 0; i < 3; ++i) {
      isMissing = i < 2;
      await other.show(new ArrayBuffer(8)).catch((error: Error) => refusals.push(error.message));
    }
    other.dispose();
    window.Worker = Worker;
    return refusals;
  },

  /** Whether a canvas that cannot have WebGL2 gets a viewer. */
  hasViewerWithoutWebGl(): boolean {
    const other = document.createElement("canvas");
    other.getContext("2d");
    return createViewer(other, "/decode_worker.js") !== null;
  },

  camera: (): Camera => view().camera,
  grid: (): GridInfo | null => view().grid,
  pick: (x: number, y: number): Hit | null => view().pick(x, y),
  visibleCells: () => view().visibleCells(),
  pixelsPerCell: (): number => view().pixelsPerCell(),
  canvasSize: (): [number, number] => [canvas.width, canvas.height],
  violations: (): string[] => violations,
  clear: (): void => view().clear(),
  dispose: (): void => view().dispose(),

  /** Loses the context and gets another one. */
  async loseContext(): Promise<void> {
    const extension = canvas.getContext("webgl2")!.getExtension("WEBGL_lose_context")!;
    const event = (name: string): Promise<unknown> =>
      new Promise((resolve) => canvas.addEventListener(name, resolve, { once: true }));
    const lost = event("webglcontextlost");
    extension.loseContext();
    await lost;
    await new Promise((resolve) => setTimeout(resolve, 50));
    const restored = event("webglcontextrestored");
    extension.restoreContext();
    await restored;
  },
};

export type Api = typeof api;
(globalThis as unknown as { api: Api }).api = api;
