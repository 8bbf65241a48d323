// Draws parts of images with one WebGL2 context.
import { GridTextures, type Target } from "./gl_objects";
import type { Variant } from "./params";
import { Programs } from "./programs";

const POLL_MS = 1;

/** The context was lost while something was drawn. */
export class ContextLost extends Error {}

export class Painter {
  textures: GridTextures;
  readonly #programs: Programs;
  readonly #block: WebGLBuffer;

  constructor(readonly gl: WebGL2RenderingContext) {
    this.textures = new GridTextures(gl);
    this.#programs = new Programs(gl);
    this.#block = gl.createBuffer();
    gl.bindVertexArray(gl.createVertexArray());
    for (const off of [gl.BLEND, gl.DEPTH_TEST, gl.CULL_FACE, gl.DITHER]) gl.disable(off);
  }

  program(variant: Variant): Promise<WebGLProgram> {
    return this.#programs.get(variant);
  }

  /** Draws rows [first, end) of an image, which has the target's size. */
  draw(
    program: WebGLProgram,
    params: ArrayBuffer,
    target: Target,
    first: number,
    end: number,
    textures = this.textures,
  ): void {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.viewport(0, 0, target.width, target.height);
    gl.useProgram(program);
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, this.#block);
    gl.bufferData(gl.UNIFORM_BUFFER, params, gl.DYNAMIC_DRAW);
    textures.bind();
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, first, target.width, end - first);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.SCISSOR_TEST);
  }

  /** Puts an image on the canvas, enlarged to its size. */
  present(target: Target): void {
    const { gl } = this,
      width = gl.drawingBufferWidth,
      height = gl.drawingBufferHeight;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, target.framebuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    const isSame = target.width === width && target.height === height;
    gl.blitFramebuffer(
      0,
      0,
      target.width,
      target.height,
      0,
      0,
      width,
      height,
      gl.COLOR_BUFFER_BIT,
      isSame ? gl.NEAREST : gl.LINEAR,
    );
  }

  /** Fills the canvas with one colour of sRGB, 0..1. */
  fill(color: readonly [number, number, number]): void {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.clearColor(...color, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /** RGBA of an image, the lowest row first. */
  read(target: Target): Uint8Array<ArrayBuffer> {
    const { gl } = this,
      pixels = new Uint8Array(4 * target.width * target.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.readPixels(0, 0, target.width, target.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return pixels;
  }

  /** Waits until everything so far is drawn. Rejects with ContextLost. */
  async finished(): Promise<void> {
    const { gl } = this,
      sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    for (;;) {
      if (!sync || gl.isContextLost()) throw new ContextLost("the WebGL context is lost");
      const status = gl.clientWaitSync(sync, gl.SYNC_FLUSH_COMMANDS_BIT, 0);
      if (status === gl.ALREADY_SIGNALED || status === gl.CONDITION_SATISFIED) break;
      if (status === gl.WAIT_FAILED) throw new ContextLost("waiting for WebGL failed");
      await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    }
    gl.deleteSync(sync);
  }
}
