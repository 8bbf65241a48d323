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
    if (value == null || value === false) continue;
    if (name.startsWith("on") && typeof value === "function") {
      element.addEventListener(name.slice(2), value as EventListener);
    } else if (name in element && name !== "list") {
      (element as unknown as Record<string, unknown>)[name] = value;
    } else {
      element.setAttribute(
        name === "className" ? "class" : name,
        value === true ? "" : String(value),
      );
    }
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
export function field(label: string, control: HTMLElement, hint = ""): HTMLElement {
  control.id ||= `field-${++labels}`;
  return h(
    "div",
    { className: "field" },
    h("label", { htmlFor: control.id }, label),
    control,
    hint && h("small", {}, hint),
  );
}

export interface Choice {
  readonly value: string;
  readonly text: string;
  readonly group?: string;
}

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
  for (const choice of choices) {
    if (choice.group && (!group || group.label !== choice.group)) {
      group = h("optgroup", { label: choice.group });
      element.append(group);
    }
    (choice.group && group ? group : element).append(
      h("option", { value: choice.value }, choice.text),
    );
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
  for (const choice of choices) {
    const input = h("input", {
      type: "radio",
      name,
      value: choice.value,
      checked: choice.value === value,
      onchange: () => onchange(choice.value),
    });
    set.append(h("label", {}, input, h("span", {}, choice.text)));
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
