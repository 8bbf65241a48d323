// Serves the page and what it compares, with the policy that the daemon's page has.
import { readFileSync, writeFileSync, existsSync } from "node:fs";
import { createServer, type IncomingMessage, type Server, type ServerResponse } from "node:http";
import type { AddressInfo } from "node:net";
import { basename, extname, join } from "node:path";

const POLICY =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; " +
  "connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const TYPES: Record<string, string> = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".png": "image/png",
};

export class PageServer {
  /** What /data/NAME gives. */
  readonly data = new Map<string, Uint8Array>();
  private readonly server: Server;

  constructor(private readonly folder: string) {
    this.server = createServer((request, response) => this.answer(request, response));
  }

  async start(): Promise<string> {
    await new Promise<void>((resolve) => this.server.listen(0, "127.0.0.1", resolve));
    return `http://127.0.0.1:${(this.server.address() as AddressInfo).port}`;
  }

  stop(): void {
    this.server.close();
    this.server.closeAllConnections();
  }

  private answer(request: IncomingMessage, response: ServerResponse): void {
    const name = basename(decodeURIComponent(request.url ?? "/"));
    if (request.method === "POST") return this.save(name, request, response);
    const file = join(this.folder, name);
    const body = request.url!.startsWith("/data/")
      ? this.data.get(name)
      : existsSync(file)
        ? readFileSync(file)
        : undefined;
    if (!body) {
      response.writeHead(404).end();
      return;
    }
    const type = TYPES[extname(name)] ?? "application/octet-stream";
    response.writeHead(200, { "Content-Type": type, "Content-Security-Policy": POLICY }).end(body);
  }

  /** Keeps an image for whoever looks at a failed test (run_tests.py --keep). */
  private save(name: string, request: IncomingMessage, response: ServerResponse): void {
    const parts: Buffer[] = [];
    request.on("data", (part: Buffer) => parts.push(part));
    request.on("end", () => {
      writeFileSync(join(this.folder, name), Buffer.concat(parts));
      response.writeHead(204).end();
    });
  }
}
