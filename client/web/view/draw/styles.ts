// Facts of the styles of /v1/render: proto/options/rules.cpp and server/render/raymarch_params.cpp.
import type { Style } from "../viewer";

export type Srgb = readonly [number, number, number]; // 0..255

export interface StyleFacts {
  readonly occlusion: boolean;
  readonly shadow: boolean;
  readonly ground: boolean;
  readonly bottom: Srgb; // background at the lower edge
  readonly top: Srgb;
}

const LIGHT = { bottom: [214, 219, 226], top: [250, 251, 252] } as const;
const GREY = [224, 229, 236] as const,
  WHITE = [255, 255, 255] as const;

export const STYLES: Readonly<Record<Style, StyleFacts>> = {
  voxel: { occlusion: true, shadow: true, ground: true, ...LIGHT },
  clay: { occlusion: true, shadow: true, ground: true, ...LIGHT },
  smooth: { occlusion: false, shadow: false, ground: false, bottom: WHITE, top: WHITE },
  iso: { occlusion: true, shadow: false, ground: false, bottom: GREY, top: GREY },
  blueprint: {
    occlusion: false,
    shadow: false,
    ground: false,
    bottom: [22, 58, 112],
    top: [30, 74, 136],
  },
};
