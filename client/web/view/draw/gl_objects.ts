// The few kinds of GL objects that the viewer has.
import { TABLE_COLUMNS, type PackedGrid, type Words } from "../pack/packed_grid";

/** A picture that is drawn off the screen: RGBA with straight alpha. */
export interface Target {
  readonly framebuffer: WebGLFramebuffer;
  readonly texture: WebGLTexture;
  readonly width: number;
  readonly height: number;
}

function nearest(gl: WebGL2RenderingContext, unit: number): WebGLTexture {
  const texture = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  return texture;
}

// Beside the units of the tables, so that targets never unbind those.
const TARGET_UNIT = 4;

export function createTarget(gl: WebGL2RenderingContext, width: number, height: number): Target {
  const texture = nearest(gl, TARGET_UNIT),
    framebuffer = gl.createFramebuffer();
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  return { framebuffer, texture, width, height };
}

export function deleteTarget(gl: WebGL2RenderingContext, target: Target | null): void {
  if (!target) return;
  gl.deleteFramebuffer(target.framebuffer);
  gl.deleteTexture(target.texture);
}

/** Names of the samplers, by texture unit. */
export const TABLES = ["nodes", "bricks", "colors", "normals"] as const;

/** The tables of one grid as textures. */
export class GridTextures {
  readonly #textures: WebGLTexture[];
  images = 0; // that are drawn from them now

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.#textures = TABLES.map((_, unit) => nearest(gl, unit));
  }

  upload(grid: PackedGrid, colors: Words | null): void {
    const none = new Uint32Array(TABLE_COLUMNS);
    const tables = [grid.nodes, grid.bricks, colors ?? none, grid.attributes.normal ?? none];
    const { gl } = this;
    tables.forEach((words, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, this.#textures[unit]!);
      gl.texImage2D(
        gl.TEXTURE_2D,
        0,
        gl.R32UI,
        TABLE_COLUMNS,
        words.length / TABLE_COLUMNS,
        0,
        gl.RED_INTEGER,
        gl.UNSIGNED_INT,
        words,
      );
    });
  }

  bind(): void {
    this.#textures.forEach((texture, unit) => {
      this.gl.activeTexture(this.gl.TEXTURE0 + unit);
      this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
    });
  }

  dispose(): void {
    for (const texture of this.#textures) this.gl.deleteTexture(texture);
  }
}
