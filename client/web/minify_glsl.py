"""Makes the text of a shader shorter: names that only the text itself uses, and blanks. The program stays the same.

Kept are names of the language, of macros (variants define them) and of `kept`: uniforms, which scripts name.
"""
import itertools
import re
import string

WORD = re.compile(r"\b[A-Za-z_]\w*\b")
# Keywords and built-in functions of GLSL ES 3.00 that a name must not be, or that the text may use.
LANGUAGE = set("""
attribute bool break bvec2 bvec3 bvec4 case centroid const continue default discard do else false flat float for highp if
in inout int invariant isampler2D ivec2 ivec3 ivec4 layout location lowp mat2 mat3 mat4 mediump out precision return
sampler2D smooth std140 struct switch true uint uniform usampler2D uvec2 uvec3 uvec4 varying vec2 vec3 vec4 void while
asm cast class enum extern external filter fixed goto half hvec2 hvec3 hvec4 image1D image2D inline input interface long
namespace noinline output packed partition public resource sample short sizeof static superp template this typedef union
unsigned using volatile
abs acos acosh all any asin asinh atan atanh ceil clamp cos cosh cross dFdx dFdy degrees determinant distance dot equal
exp exp2 faceforward floatBitsToInt floatBitsToUint floor fract fwidth greaterThan greaterThanEqual intBitsToFloat inverse
inversesqrt isinf isnan length lessThan lessThanEqual log log2 main matrixCompMult max min mix mod modf normalize not
notEqual outerProduct pow radians reflect refract round roundEven sign sin sinh smoothstep sqrt step tan tanh texelFetch
texture textureSize transpose trunc uintBitsToFloat
""".split())
SWIZZLE = re.compile(r"[xyzw]{1,4}|[rgba]{1,4}|[stpq]{1,4}")
CONDITION = re.compile(r"\s*#\s*(if|ifdef|ifndef|elif|undef)\b")
CONSTANT = re.compile(r"^[ \t]*#[ \t]*define[ \t]+(\w+)[ \t]+(-?\d[\w.]*)[ \t]*$", re.M)
TYPE_ALIAS = re.compile(r"^#define (double|dvec[234]) (\w+)$")
SHORTEST = 3  # letters of a name that is replaced
PUNCTUATION = re.compile(r"\s*([-+*/%=<>!&|^?:;,(){}\[\]])\s*")


def short_names(used):
    for length in (1, 2, 3):
        for letters in itertools.product(string.ascii_letters, repeat=length):
            name = "".join(letters)
            if name not in used and name not in LANGUAGE and not SWIZZLE.fullmatch(name):
                yield name


def renamed(text, kept):
    macros = {word for line in text.split("\n") if line.lstrip().startswith("#") for word in WORD.findall(line)}
    counts = {}
    for word in WORD.findall(text):
        counts[word] = counts.get(word, 0) + 1
    replaced = [word for word in sorted(counts, key=lambda word: (-counts[word], word))
                if len(word) >= SHORTEST and word not in LANGUAGE | macros | kept
                and not word.startswith("gl_") and not SWIZZLE.fullmatch(word)]
    names = dict(zip(replaced, short_names(set(counts))))
    return WORD.sub(lambda match: names.get(match.group(), match.group()), text)


def without_constants(text):
    """Macros that are one number or the name of a type become that, unless a condition asks for them."""
    asked = {word for line in text.split("\n") if CONDITION.match(line) for word in WORD.findall(line)}
    constants = re.compile(f"{CONSTANT.pattern}|{TYPE_ALIAS.pattern}", re.M)
    values = {one[0] or one[2]: one[1] or one[3] for one in constants.findall(text)}
    values = {name: value for name, value in values.items() if name not in asked}
    text = constants.sub(lambda match: "" if (match[1] or match[3]) in values else match.group(), text)
    return WORD.sub(lambda match: values.get(match.group(), match.group()), text)


def without_branches(text, never):
    """The text without what is compiled only where a name of `never` is defined (#ifdef, #ifndef, #else, #endif)."""
    lines, nesting = [], []  # of each open condition: the name if it is one of `never`, and whether its lines stay
    for line in text.split("\n"):
        word = line.split() or [""]
        stays = all(one[1] for one in nesting)
        if word[0] in ("#ifdef", "#ifndef") and word[1] in never:
            nesting.append([word[1], word[0] == "#ifndef"])
            continue
        if word[0].startswith("#if"):
            nesting.append(["", True])
        elif word[0] == "#else" and nesting[-1][0]:
            nesting[-1][1] = not nesting[-1][1]
            continue
        elif word[0] == "#endif" and nesting.pop()[0]:
            continue
        if stays:
            lines.append(line)
    return "\n".join(lines)


def short_numbers(text):
    """32.0f becomes 32. and 0.5 becomes .5"""
    text = re.sub(r"(\d\.\d*)[fF]\b", r"\1", text)
    text = re.sub(r"\b(\d+)\.0+\b", r"\1.", text)
    return re.sub(r"(?<![\w.])0(\.\d)", r"\1", text)


def minified(text, kept, never=(), variant_line="VARIANT"):
    """The shader's text, without the names that only it uses. Lines of the preprocessor stay lines. Names of `never` are
    not defined in any variant."""
    text = short_numbers(without_branches(text, never))
    lines, code = [], ""
    for line in [*renamed(without_constants(text), kept | {variant_line}).split("\n"), "#"]:
        line = line.strip()
        if not line.startswith("#") and line != variant_line:
            code += line + " "
            continue
        if code.strip():
            lines.append(PUNCTUATION.sub(r"\1", code).strip())
        code = ""
        lines.append(re.sub(r"\s+", " ", line))
    return "\n".join(lines[:-1]) + "\n"
