"""Baked textures in WebGL 2 of Debian's chromium, which runs shaders without a graphics card."""

import json
import re
import subprocess

import numpy as np
import pytest
from webgl import CHROMIUM, GRAPHICS, OPTIONS

from qmcjax import samplers, sequences
from qmcjax.bridges import bake

pytestmark = [pytest.mark.browser, pytest.mark.skipif(CHROMIUM is None, reason="no chromium")]

PAGE = """<!doctype html><pre id="found">nothing</pre><canvas id="canvas"></canvas><script>
const shader = (kind, source) => {
  const made = gl.createShader(kind);
  gl.shaderSource(made, source);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw gl.getShaderInfoLog(made);
  gl.attachShader(program, made);
};
const say = (text) => { document.getElementById("found").textContent = text; };
try {
  var gl = document.getElementById("canvas").getContext("webgl2");
  if (!gl) throw "no WebGL 2";
  if (!gl.getExtension("EXT_color_buffer_float")) throw "no float targets";
  var program = gl.createProgram();
  shader(gl.VERTEX_SHADER, `#version 300 es
    void main() {
      ivec2 corner = ivec2(gl_VertexID % 2, gl_VertexID / 2);
      gl_Position = vec4(vec2(corner) * 4.0 - 1.0, 0, 1);
    }`);
  shader(gl.FRAGMENT_SHADER, `#version 300 es
    precision highp float; precision highp int; precision highp usampler2D;
    uniform usampler2D texels; out vec4 colour;
    @READER@
    void main() {
      uint column = uint(gl_FragCoord.x), row = uint(gl_FragCoord.y);
      uint s = column / @WIDTH@u, g = row / @HEIGHT@u;
      colour = vec4(table_point(texels, column % @WIDTH@u, row % @HEIGHT@u, s, g), 0, 1);
    }`);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw gl.getProgramInfoLog(program);
  gl.useProgram(program);
  const texture = (inside, width, height, format, type, values) => {
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, type, values);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  };
  const frame = gl.createFramebuffer(), target = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, target);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, @COLUMNS@, @ROWS@);
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
  texture(gl.RG16UI, @TEXTURE@, gl.RG_INTEGER, gl.UNSIGNED_SHORT, new Uint16Array(@VALUES@));
  gl.viewport(0, 0, @COLUMNS@, @ROWS@);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  const found = new Float32Array(4 * @COLUMNS@ * @ROWS@);
  gl.readPixels(0, 0, @COLUMNS@, @ROWS@, gl.RGBA, gl.FLOAT, found);
  say(JSON.stringify(Array.from(new Uint32Array(found.buffer))));
} catch (error) { say("failed: " + error); }
</script>"""


def test_shaders_read_the_very_bits(tmp_path):
    """The pixels of two tiles beside and below each other, all samples and pairs of coordinates."""
    table = bake(samplers.independent(sequences.sobol(3), key=3), (6, 4), 8, (0, 1, 2))
    table.save(tmp_path / "table.rg16")
    texels = np.fromfile(tmp_path / "table.rg16", "<u2")
    width, height = map(int, re.search(r"Texture: (\d+) x (\d+)", table.reader("glsl")).groups())
    columns, rows = 12 * 8, 8 * 2
    filled = {
        "READER": table.reader("glsl"),
        "WIDTH": "12",
        "HEIGHT": "8",
        "COLUMNS": str(columns),
        "ROWS": str(rows),
        "TEXTURE": f"{width}, {height}",
        "VALUES": json.dumps(texels.tolist()),
    }
    page = PAGE
    for word, text in filled.items():
        page = page.replace(f"@{word}@", text)
    (tmp_path / "page.html").write_text(page)
    address = (tmp_path / "page.html").as_uri()
    command = [CHROMIUM, *OPTIONS, *GRAPHICS, f"--user-data-dir={tmp_path / 'user'}", "--dump-dom", address]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    said = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)[1]
    assert said.startswith("["), said
    found = np.array(json.loads(said), np.uint32).view(np.float32).reshape(2, 8, 8, 12, 4)[..., :2]
    found = found.transpose(1, 3, 2, 0, 4).reshape(8, 12, 8, 4)[..., :3]
    assert np.array_equal(found, np.tile(table.points, (2, 2, 1, 1)))
