// Daemon, page server and browser of one test file.
import { after, before } from "node:test";
import { Browser } from "./chromium";
import { Daemon } from "./daemon";
import { PageServer } from "./server";

export class Session {
  readonly server = new PageServer(process.env["VIEW_TEST_DIR"]!);
  readonly daemon = new Daemon(process.env["VOXELD_BIN_DIR"]!);
  browser!: Browser;

  /** width, height: of the canvas in CSS pixels. */
  constructor(
    private readonly width: number,
    private readonly height: number,
  ) {
    before(() => this.start());
    after(() => this.stop());
  }

  private async start(): Promise<void> {
    await this.daemon.start();
    const url = await this.server.start();
    this.browser = new Browser();
    await this.browser.open(`${url}/page.html`);
    if (!(await this.browser.call("open", this.width, this.height))) throw new Error("no WebGL2");
    console.log("renderer:", await this.browser.call("renderer"));
  }

  private async stop(): Promise<void> {
    if (this.browser) {
      for (const line of this.browser.console) console.log("console:", line);
      await this.browser.close();
    }
    this.server.stop();
    await this.daemon.stop();
  }
}
