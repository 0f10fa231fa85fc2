"""Source code in GLSL ES 3.00, run by WebGL 2 in Debian's chromium, without a graphics card."""

import base64
import json
import re
import shutil
import subprocess

import numpy as np

CHROMIUM = shutil.which("chromium")
OPTIONS = "--headless --no-sandbox --disable-quic --no-first-run --disable-background-networking".split()
GRAPHICS = "--use-angle=swiftshader --enable-unsafe-swiftshader --ignore-gpu-blocklist --disable-gpu-watchdog"
GRAPHICS = GRAPHICS.split()
NO_GRAPHICS = ("--disable-gpu", "--disable-software-rasterizer")
COLUMNS = 1024
"""Columns of all textures."""

CALLS = {"sampler": "mine({words}{seeds}, u)", "sequence": "mine({words}{seeds}, u)"}
CALLS["order"] = "u[0] = uintBitsToFloat(mine({words}{seeds}))"

FRAGMENT = """#version 300 es
precision highp float; precision highp int; precision highp usampler2D;
uniform uint first; out uvec4 found;
@SOURCE@
uint drawn(uint i, uint k) {
    uint word = (i * 8u + k) * 2654435769u;
    word = (word ^ (word >> 16u)) * 2246822507u;
    word = (word ^ (word >> 13u)) * 3266489909u;
    return word ^ (word >> 16u);
}
void main() {
    uint i = uint(gl_FragCoord.y) * @COLUMNS@u + uint(gl_FragCoord.x);
    float u[@SIZE@];
    @CALL@;
    uvec4 bits = uvec4(0u);
    for (uint k = 0u; k < 4u && first + k < @SIZE@u; k++) bits[k] = floatBitsToUint(u[first + k]);
    found = bits;
}"""

PAGE = """<!doctype html><pre id="found">nothing</pre><canvas id="canvas"></canvas><script>
const cases = @CASES@;
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const gl = document.getElementById("canvas").getContext("webgl2");
const shader = (program, kind, source) => {
  const made = gl.createShader(kind);
  gl.shaderSource(made, source);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw gl.getShaderInfoLog(made);
  gl.attachShader(program, made);
};
const texture = ({size, texels}) => {
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  const values = new Uint32Array(bytes(texels));
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32UI, ...size, 0, gl.RED_INTEGER, gl.UNSIGNED_INT, values);
};
const run = (source, given, rows, size) => {
  const program = gl.createProgram();
  shader(program, gl.VERTEX_SHADER, `#version 300 es
    void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0, 1); }`);
  shader(program, gl.FRAGMENT_SHADER, source);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw gl.getProgramInfoLog(program);
  gl.useProgram(program);
  if (given) {
    texture(given);
    gl.uniform1i(gl.getUniformLocation(program, "mine_tables"), 0);
  }
  const target = gl.createTexture();
  gl.activeTexture(gl.TEXTURE1);
  gl.bindTexture(gl.TEXTURE_2D, target);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32UI, @COLUMNS@, rows);
  const buffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
  gl.viewport(0, 0, @COLUMNS@, rows);
  const count = rows * @COLUMNS@, found = new Uint32Array(4 * count);
  let sum = 0;
  for (let first = 0; first < size; first += 4) {
    gl.uniform1ui(gl.getUniformLocation(program, "first"), first);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.readPixels(0, 0, @COLUMNS@, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, found);
    for (let i = 0; i < count; i++) for (let k = first; k < Math.min(size, first + 4); k++) {
      const word = Math.imul(found[4 * i + k - first] ^ Math.imul(i * size + k, 0x9e3779b1), 0x85ebca6b);
      sum = sum + Math.imul(word ^ word >>> 15, 0xc2b2ae35) | 0;
    }
  }
  gl.deleteFramebuffer(buffer);
  gl.deleteTexture(target);
  return sum >>> 0;
};
const results = cases.map((one) => {
  try { return run(...one); } catch (error) { return "failed: " + error; }
});
document.getElementById("found").textContent = JSON.stringify(results);
</script>"""


def drawn(count, limits):
    """Return random words below limits, as the fragment shader draws them: one array for each limit."""
    i, made = np.arange(count, dtype=np.uint32), []
    for k, limit in enumerate(limits):
        word = (i * np.uint32(8) + np.uint32(k)) * np.uint32(2654435769)
        word = (word ^ (word >> 16)) * np.uint32(2246822507)
        word = (word ^ (word >> 13)) * np.uint32(3266489909)
        word = word ^ (word >> 16)
        made.append(word if limit == 2**32 else word % np.uint32(limit))
    return made


def summed(words):
    """Return what the page makes of all words, shape (count, size)."""
    words = np.asarray(words).view(np.uint32)
    place = np.arange(words.size, dtype=np.uint32).reshape(words.shape) * np.uint32(0x9E3779B1)
    words = (words ^ place) * np.uint32(0x85EBCA6B)
    return int(((words ^ (words >> 15)) * np.uint32(0xC2B2AE35)).sum(dtype=np.uint32))


def case(text, kind, count, limits, size):
    """Return a case for :func:`run`: a source, whose function ``mine`` is called with random words."""
    seeds = ", mine_seeds" if "mine_seeds" in text else ""
    remainders = ["" if limit == 2**32 else f" % {limit}u" for limit in limits]
    words = [f"drawn(i, {k}u){remainder}" for k, remainder in enumerate(remainders)]
    source = FRAGMENT
    check = "; if (max(gl_FragCoord.x, gl_FragCoord.y) < 1.0 && mine_check() != 0) u[0] = 9.0"
    call = CALLS[kind].format(seeds=seeds, words=", ".join(words)) + check * ("mine_check" in text)
    for word, value in (("SIZE", str(size)), ("CALL", call), ("COLUMNS", str(COLUMNS)), ("SOURCE", text)):
        source = source.replace(f"@{word}@", value)
    given = None
    if text.tables.size:
        rows = -(-text.tables.size // COLUMNS)
        words = np.pad(text.tables, (0, rows * COLUMNS - text.tables.size))
        texels = base64.b64encode(np.ascontiguousarray(words).tobytes()).decode()
        given = {"size": (COLUMNS, rows), "texels": texels}
    return source, given, -(-count // COLUMNS), size


def run(folder, cases, timeout=600):
    """Return what each case computes, :func:`summed`, or the message of an error."""
    page = PAGE.replace("@COLUMNS@", str(COLUMNS)).replace("@CASES@", json.dumps(cases))
    (folder / "page.html").write_text(page)
    address = (folder / "page.html").as_uri()
    patience = ["--virtual-time-budget=100000000", f"--timeout={1000 * timeout}"]
    command = [CHROMIUM, *OPTIONS, *GRAPHICS, *patience, f"--user-data-dir={folder / 'user'}", "--dump-dom"]
    done = subprocess.run([*command, address], capture_output=True, text=True, timeout=timeout)
    said = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)[1]
    assert said.startswith("["), said[:2000]
    return json.loads(said)
