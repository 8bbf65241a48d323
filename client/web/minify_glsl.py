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
CONSTANT = re.compile(r"^[ \t]*#[ \t]*define[ \t]+(\w+)[ \t]+(-?\.?\d[\w.]*)[ \t]*$", re.M)
TYPE_ALIAS = re.compile(r"^#define (double|dvec[234]) (\w+)$")
TOKEN = re.compile(r"^[ \t]*#.*$|\.?\b[A-Za-z_]\w*\b|[{}();]", re.M)
# First letters of names by their scope: members have none that components of vectors have.
FIRST_LETTERS = {"": string.ascii_uppercase, ".": "cdefhijklmnouv"}
PUNCTUATION = re.compile(r"\s*([-+*/%=<>!&|^?:;,(){}\[\]])\s*")


def short_names(first, taken):
    for length in (1, 2, 3):
        for letters in itertools.product(first, *[string.ascii_letters] * (length - 1)):
            name = "".join(letters)
            if name not in taken and name not in LANGUAGE:
                yield name


def scoped_words(text):
    """(start, end, word, scope) of each word. scope: "." for members of structs, "" for names of the whole text, the
    number of a function for what stands in its parameters and body."""
    words, braces, brackets, function, block, before = [], 0, 0, 0, "", ""
    for match in TOKEN.finditer(text):
        token = match.group()
        if token == "{":
            braces += 1
        elif token == "(":
            brackets += 1
        elif token == ")":
            brackets -= 1
        elif token in "};":
            braces -= token == "}"
            if braces == 0:
                function, block = function + 1, ""
        elif token[0] != "#":
            word = token.lstrip(".")
            is_outside = braces == 0 and brackets == 0
            if is_outside and word in ("struct", "uniform"):
                block = word
            is_member = token[0] == "." or (block == "struct" and braces == 1 and before not in "{;")
            scope = "." if is_member else "" if is_outside or block else function
            words.append((match.end() - len(word), match.end(), word, scope))
        before = token
    return words


def renamed(text, kept):
    """Names of the whole text and of members are the shorter the more they are used. Names in a function are letters in
    the order of their use: the same in each function, which compresses well."""
    kept = LANGUAGE | kept | {word for line in text.split("\n") if line.lstrip().startswith("#")
                              for word in WORD.findall(line)}
    words = scoped_words(text)
    known = {word for _, _, word, scope in words if scope == ""}
    places = {}  # scope -> word -> where
    for start, end, word, scope in words:
        if word in kept or word.startswith("gl_") or (scope == "." and SWIZZLE.fullmatch(word)):
            continue
        places.setdefault("" if word in known and scope != "." else scope, {}).setdefault(word, []).append((start, end))
    taken = set().union(*places.values()) & kept
    changes = []
    for scope, found in places.items():
        rank = (lambda word: (-len(found[word]), found[word])) if scope in FIRST_LETTERS else found.get
        names = short_names(FIRST_LETTERS.get(scope, string.ascii_lowercase), taken)
        changes += [(*place, name) for word, name in zip(sorted(found, key=rank), names) for place in found[word]]
    out, at = [], 0
    for start, end, name in sorted(changes):
        out += text[at:start], name
        at = end
    return "".join(out) + text[at:]


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
    text = re.sub(r"(?<![\w.])0(\.\d)", r"\1", text)
    return re.sub(r"\b(?:int|uint)\((\d+)(u?)\)", lambda m: m[1] + "u" * (m[0][0] == "u"), text)


def minified(text, kept, never=(), variant_line="VARIANT"):
    """The shader's text, without the names that only it uses. Lines of the preprocessor stay lines. Names of `never` are
    not defined in any variant."""
    text = short_numbers(without_constants(without_branches(text, never)))
    lines, code = [], ""
    for line in [*renamed(text, kept | {variant_line}).split("\n"), "#"]:
        line = line.strip()
        if not line.startswith("#") and line != variant_line:
            code += line + " "
            continue
        if code.strip():
            lines.append(PUNCTUATION.sub(r"\1", code).strip())
        code = ""
        lines.append(re.sub(r"\s+", " ", line))
    return "\n".join(lines[:-1]) + "\n"
