// Variants of the ray march, compiled when they are first needed and without waiting for them.
import raymarchText from "voxeld-shaders/raymarch.es.glsl";
import { TABLES } from "./gl_objects";
import type { Variant } from "./params";

const VERTEX_TEXT = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

const POLL_MS = 5;

function macrosOf(variant: Variant): string {
  return Object.entries(variant)
    .map(([name, on]) => `#define RAYMARCH_${name.toUpperCase()} ${on ? 1 : 0}`)
    .join("\n");
}

export class Programs {
  readonly #programs = new Map<string, Promise<WebGLProgram>>();
  readonly #parallel: { COMPLETION_STATUS_KHR: number } | null;

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.#parallel = gl.getExtension("KHR_parallel_shader_compile");
  }

  /** Rejects with the driver's words. */
  get(variant: Variant): Promise<WebGLProgram> {
    const macros = macrosOf(variant);
    let program = this.#programs.get(macros);
    if (!program) this.#programs.set(macros, (program = this.#compile(macros)));
    return program;
  }

  #shader(kind: number, text: string): WebGLShader {
    const { gl } = this,
      shader = gl.createShader(kind);
    if (!shader) throw new Error("WebGL made no shader");
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    return shader;
  }

  async #compile(macros: string): Promise<WebGLProgram> {
    const { gl } = this,
      program = gl.createProgram();
    const vertex = this.#shader(gl.VERTEX_SHADER, VERTEX_TEXT);
    const fragment = this.#shader(gl.FRAGMENT_SHADER, raymarchText.replace("VARIANT", macros));
    gl.attachShader(program, vertex);
    gl.attachShader(program, fragment);
    gl.linkProgram(program);
    while (
      this.#parallel &&
      !gl.isContextLost() &&
      !gl.getProgramParameter(program, this.#parallel.COMPLETION_STATUS_KHR)
    ) {
      await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    }
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      throw new Error(
        `ray march: ${gl.getShaderInfoLog(fragment) || gl.getProgramInfoLog(program)}`,
      );
    }
    gl.deleteShader(vertex);
    gl.deleteShader(fragment);
    gl.useProgram(program);
    TABLES.forEach((name, unit) => gl.uniform1i(gl.getUniformLocation(program, name), unit));
    gl.uniformBlockBinding(program, gl.getUniformBlockIndex(program, "Params"), 0);
    return program;
  }
}
