// The look of the view: style, channel, section; and the voxel under the pointer.
import { field, h, segments, select, setChoices, type Choice } from "./dom";
import type { GridMeta, NamedId } from "./model";
import { START } from "../view/controls";
import type { Stage } from "./stage";
import { hexOf, names, t, T } from "./texts";
import type { Channel, Hit, Section, Style, Vec3 } from "../view/viewer";

const STYLES = ["voxel", "smooth", "clay", "iso", "blueprint"] as const;
const AXES = ["x", "y", "z"] as const;
type Axis = (typeof AXES)[number];
const BOX = "box";
type Cut = Axis | typeof BOX | "";

// Makes a slider's range that of a grid, and puts it to a share of the range, or to that of before.
function rescale(slider: HTMLInputElement, cells: number, share: number, keeps: boolean): void {
  const before = Number(slider.max);
  const kept = keeps && before > 0 ? Number(slider.value) / before : share;
  slider.max = String(cells);
  slider.value = String(Math.round(cells * kept));
}

export class Look {
  #axis: Cut = "";
  #isFlipped = false;
  readonly #channels = h("select");
  readonly #channelField: HTMLElement;
  readonly #cut = h("input", {
    type: "range",
    id: "cut",
    "aria-label": T.section,
    oninput: () => this.#showCut(),
  });
  readonly #cutRow: HTMLElement;
  readonly #cutText = h("output", { htmlFor: "cut" });
  // The ends of the box along each axis, and their cells as text.
  readonly #ends = AXES.map(axis =>
    [T.boxFrom, T.boxTo].map(text =>
      h("input", {
        type: "range",
        "aria-label": t(text, { axis }),
        oninput: () => this.#showCut(),
      }),
    ),
  );
  readonly #endsTexts = AXES.map(() => h("output"));
  readonly #boxRows = h(
    "div",
    { hidden: true },
    ...AXES.map((axis, k) =>
      h("div", { className: "row cut" }, axis, ...this.#ends[k]!, this.#endsTexts[k]),
    ),
  );
  #meta: GridMeta = {};
  #from: Hit["cell"] | null = null; // where a measure begins, in the grid's cells

  constructor(
    parent: HTMLElement,
    private readonly stage: Stage,
    private readonly pickText: HTMLElement,
    canvas: HTMLCanvasElement,
  ) {
    this.#channels.onchange = () => {
      this.stage.channel = (this.#channels.value || null) as Channel | null;
    };
    this.#channelField = field(T.channel, this.#channels);
    const flip = h(
      "button",
      {
        "aria-pressed": "false",
        onclick: () => {
          this.#isFlipped = !this.#isFlipped;
          flip.setAttribute("aria-pressed", String(this.#isFlipped));
          this.#showCut();
        },
      },
      T.flip,
    );
    this.#cutRow = h("div", { className: "row cut", hidden: true }, this.#cut, this.#cutText, flip);
    parent.append(
      field(
        T.style,
        select(
          STYLES.map(value => [value, names[`style_${value}`]!]),
          "voxel",
          value => {
            this.stage.style = value as Style;
          },
        ),
      ),
      this.#channelField,
      segments(
        T.section,
        [
          ["", T.sectionOff],
          ...AXES.map((value): Choice => [value, value]),
          ...(stage.viewer ? [[BOX, T.box] as const] : []), // the daemon's pictures have none
        ],
        "",
        value => this.#choose(value as Cut),
      ),
      this.#cutRow,
      this.#boxRows,
      h(
        "div",
        { className: "row" },
        h("button", { id: "reset", onclick: () => { this.stage.camera = START; } }, T.resetView),
      ),
    );
    canvas.onpointermove = event => {
      if (event.buttons === 0) this.#pick(event);
    };
    canvas.onclick = event => this.#pick(event); // a finger does not move there
    canvas.ondblclick = event => {
      const hit = this.#hit(event);
      this.#from = hit && this.stage.cellOf(hit);
      this.#pick(event);
    };
    canvas.onpointerleave = () => {
      this.pickText.hidden = true;
    };
    this.show({});
  }

  /** Another mesh comes: no voxel of it is marked. */
  forget(): void {
    this.#from = null;
  }

  /** Adapts to the grid that is shown, or to another view of it. */
  show(meta = this.#meta): void {
    if (String(meta.dims) !== String(this.#meta.dims)) this.#from = null;
    this.#meta = meta;
    this.pickText.hidden = true; // of the grid before
    const grid = this.stage.grid;
    const channels = (this.stage.viewer && grid?.channels) ?? [];
    const known: Choice[] = channels.map(value => [value, names[`channel_${value}`]!]);
    const old = this.stage.channel;
    const kept = known.some(([value]) => value === old) ? (old as string) : "";
    setChoices(this.#channels, [["", T.channelOwn], ...known], kept);
    if (kept !== (old ?? "")) this.stage.channel = null;
    this.#channelField.hidden = known.length === 0;
    if (this.#axis) this.#choose(this.#axis, true);
  }

  // Distances are in voxels, or in shortest edges of a voxel if they are meant in world units.
  #distanceText(stored: number): string {
    if (this.#meta.options?.distance !== "world") return stored.toFixed(2);
    const edge = Math.min(...(this.#meta.voxel_size ?? [1]));
    return String(Number((stored * edge).toPrecision(4)));
  }

  #choose(axis: Cut, keepsPlace = false): void {
    const grid = this.stage.grid;
    this.#axis = axis;
    this.#cutRow.hidden = !axis || axis === BOX || !grid;
    this.#boxRows.hidden = axis !== BOX || !grid;
    if (grid && axis === BOX) {
      this.#ends.forEach((ends, k) =>
        ends.forEach((slider, end) => rescale(slider, grid.dims[k]!, end, keepsPlace)),
      );
    } else if (grid && axis) {
      rescale(this.#cut, grid.dims[AXES.indexOf(axis as Axis)]!, 0.5, keepsPlace);
    }
    this.#showCut();
  }

  // A coarser level's cells are several of the grid's on a side, the last ones fewer.
  #cellsOf(k: number, cut: number): readonly [cells: number, total: number] {
    const scale = 2 ** this.stage.level,
      total = this.#meta.dims?.[k] ?? this.stage.grid!.dims[k]! * scale;
    return [Math.min(total, cut * scale), total];
  }

  #showCut(): void {
    const grid = this.stage.grid;
    if (!this.#axis || !grid) {
      this.stage.section = { plane: null, box: null };
      return;
    }
    const placeOf = (k: number, cut: number) => grid.origin[k]! + cut * grid.voxelSize[k]!;
    if (this.#axis === BOX) {
      const corners = this.#ends.map((ends, k) => {
        const [low, high] = ends.map(slider => Number(slider.value)).sort((a, b) => a - b) as [
          number,
          number,
        ];
        const [begin] = this.#cellsOf(k, low),
          [end, total] = this.#cellsOf(k, high);
        this.#endsTexts[k]!.textContent = `${begin}–${end} / ${total}`;
        return [placeOf(k, low), placeOf(k, high), begin, end] as const;
      });
      const corner = (i: 0 | 1 | 2 | 3) => corners.map(ends => ends[i]) as unknown as Vec3;
      this.stage.section = { plane: null, box: [corner(0), corner(1)] };
      this.stage.region = [corner(2), corner(3)];
      return;
    }
    const k = AXES.indexOf(this.#axis);
    const cut = Number(this.#cut.value);
    const place = placeOf(k, cut);
    const [cells, total] = this.#cellsOf(k, cut);
    this.#cutText.textContent = `${cells} / ${total}`;
    this.#cut.setAttribute("aria-valuetext", t(T.sectionAt, { n: cells, total }));
    const sign = this.#isFlipped ? -1 : 1;
    const plane = [0, 0, 0, -sign * place];
    plane[k] = sign;
    this.stage.section = { plane: plane as unknown as Section["plane"], box: null };
  }

  #hit(event: MouseEvent): Hit | null {
    return this.stage.viewer?.pick(event.offsetX, event.offsetY) ?? null;
  }

  #pick(event: MouseEvent): void {
    const hit = this.#hit(event);
    this.pickText.hidden = !hit;
    if (!hit) return;
    const swatch = h("i", { className: "swatch", "aria-hidden": "true" });
    if (hit.color) swatch.style.background = `rgb(${hit.color[0]} ${hit.color[1]} ${hit.color[2]})`;
    this.pickText.replaceChildren(...(hit.color ? [swatch] : []), this.#describe(hit));
  }

  #describe(hit: Hit): string {
    const named = (list: readonly NamedId[] | undefined, id: number) =>
      list?.find(one => one.id === id)?.name || `#${id}`;
    const cell = this.stage.cellOf(hit);
    const [x, y, z] = cell;
    const parts = [t(T.cell, { x, y, z })];
    if (hit.color)
      parts.push("#" + hexOf(hit.color.slice(0, 3)));
    if (hit.material)
      parts.push(`${names["channel_material"]}: ${named(this.#meta.materials, hit.material)}`);
    if (hit.label) parts.push(`${names["channel_label"]}: ${named(this.#meta.labels, hit.label)}`);
    if (hit.distance !== undefined)
      parts.push(t(T.distanceIs, { n: this.#distanceText(hit.distance * this.stage.scale) }));
    if (hit.coverage !== undefined)
      parts.push(t(T.coverageIs, { n: Math.round(100 * hit.coverage) }));
    if (this.#from) parts.push(this.#measure(this.#from, cell));
    return parts.join(" · ");
  }

  // Between the middles of two cells.
  #measure(from: Hit["cell"], to: Hit["cell"]): string {
    const size = this.#meta.voxel_size ?? [1, 1, 1];
    const [x, y, z] = to.map((c, k) => c - (from[k] as number)) as [number, number, number];
    const n = Number(Math.hypot(x * size[0], y * size[1], z * size[2]).toPrecision(4));
    return t(T.measure, { x, y, z, n, unit: this.#meta.units ?? "" });
  }
}
