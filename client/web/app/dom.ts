// Elements without markup in strings: what comes from files and the daemon is text, never HTML.

type Child = Node | string | null | false | undefined;
type Props = Readonly<Record<string, unknown>>;

/**
 * A new element. Props that begin with "on" are listeners, `class` and names with a dash are
 * attributes, others are properties of the element.
 */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  props: Props = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (name in element) (element as unknown as Record<string, unknown>)[name] = value;
    else element.setAttribute(name, String(value));
  }
  fill(element, ...children);
  return element;
}

/** Replaces all children. */
export function fill(element: Element, ...children: Child[]): void {
  element.replaceChildren(
    ...children.filter((child): child is Node | string => child != null && child !== false),
  );
}

/** The element with this id of index.html. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`index.html has no #${id}`);
  return element as T;
}

let labels = 0;

/** A control with its label before it, in a row. */
export function field(label: string, control: HTMLElement): HTMLElement {
  control.id ||= `field-${++labels}`;
  return h(
    "div",
    { className: "field" },
    h("label", { htmlFor: control.id }, label),
    control,
  );
}

export type Choice = readonly [value: string, text: string, group?: string];

/** A select of `choices`; those of one `group` in sequence stand under its name. */
export function select(
  choices: readonly Choice[],
  value: string,
  onchange: (value: string) => void,
): HTMLSelectElement {
  const element = h("select", { onchange: () => onchange(element.value) });
  setChoices(element, choices, value);
  return element;
}

export function setChoices(
  element: HTMLSelectElement,
  choices: readonly Choice[],
  value: string,
): void {
  fill(element);
  let group: HTMLOptGroupElement | undefined;
  for (const [value, text, label] of choices) {
    if (label && group?.label !== label) element.append((group = h("optgroup", { label })));
    (group ?? element).append(h("option", { value }, text));
  }
  element.value = value;
}

/** Radio buttons that look like one control with segments. */
export function segments(
  legend: string,
  choices: readonly Choice[],
  value: string,
  onchange: (value: string) => void,
): HTMLFieldSetElement {
  const name = `segments-${++labels}`;
  const set = h("fieldset", { className: "segments" }, h("legend", {}, legend));
  for (const [one, text] of choices) {
    const input = h("input", {
      type: "radio",
      name,
      value: one,
      checked: one === value,
      onchange: () => onchange(one),
    });
    set.append(h("label", {}, input, h("span", {}, text)));
  }
  return set;
}

/** Selects the segment of `value`. */
export function setSegment(set: HTMLFieldSetElement, value: string): void {
  for (const input of set.querySelectorAll("input")) input.checked = input.value === value;
}

/** Saves bytes under a name, as if a link to them was clicked. */
export function saveBlob(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  followLink(url, name);
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

/** Clicks a link that downloads. With an empty name the response names the file. */
export function followLink(url: string, name = ""): void {
  const link = h("a", { href: url, download: name, hidden: true });
  document.body.append(link);
  link.click();
  link.remove();
}
