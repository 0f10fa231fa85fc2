// Sums of the samples of each pixel in their order, by shaders of WebGL 2: float32, rounded once for each sample. In a
// worker, since to wait for the graphics card blocks a page.
const accumulating = () => {
  const COLUMNS = 1024; // of a texture of tables, as the functions read them
  const MOST_PROGRAMS = 24; // the oldest are deleted

  const VERTEX = `#version 300 es
  void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0, 1); }`;

  // Add one sample: loops over samples around the loops of a sampler take some compilers minutes. Pixel (x, y) and a
  // point become a place on the screen as qmcjax.render maps them.
  const fragment = ({ source, scene, dims, seeds }) => `#version 300 es
  precision highp float; precision highp int; precision highp sampler2D; precision highp usampler2D;
  uniform sampler2D sums;
  uniform float size;
  uniform uint number, seeds[${seeds.length}];
  out float sum;
  ${source}
  ${scene.text}
  void main() {
      uvec2 pixel = uvec2(gl_FragCoord.xy);
      float u[${dims}], p[${scene.needs}], value[1];
      mine(pixel.x, pixel.y, number, seeds, u);
      p[0] = min((float(pixel.x) + u[0]) * size, uintBitsToFloat(0x3f7fffffu));
      p[1] = min((float(pixel.y) + u[1]) * size, uintBitsToFloat(0x3f7fffffu));
      ${scene.needs > 2 ? `for (int k = 2; k < ${scene.needs}; k++) p[k] = u[k];` : ""}
      scene(p, value);
      sum = (number == 0u ? 0.0 : texelFetch(sums, ivec2(pixel), 0).x) + value[0];
  }`;

  const gl = new OffscreenCanvas(1, 1).getContext("webgl2", { antialias: false, depth: false });
  let [side, parallel, programs, bound, targets] = [];
  let times = 0; // that all was made, for the first time or after the graphics card was lost
  const soon = () => new Promise((resolve) => { setTimeout(resolve); });
  const lost = () => new Error("lost");

  const texture = (inside, width, height, format, type, values) => {
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, type, values);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return made;
  };
  const reset = () => {
    times++;
    gl.getExtension("EXT_color_buffer_float");
    parallel = gl.getExtension("KHR_parallel_shader_compile");
    [programs, bound, targets] = [new Map(), new Map(), new Map()];
    gl.viewport(0, 0, side, side);
  };
  // One texture is read while the other is written.
  const target = (at) => {
    if (!targets.has(at)) {
      targets.set(at, [0, 1].map(() => {
        const sums = texture(gl.R32F, side, side, gl.RED, gl.FLOAT, null);
        const frame = gl.createFramebuffer();
        gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, sums, 0);
        return { sums, frame };
      }));
    }
    return targets.get(at);
  };
  const tableTexture = ({ name, tables }) => {
    if (!tables) return null;
    if (!bound.has(name)) {
      const rows = Math.ceil(tables.length / COLUMNS);
      const words = new Uint32Array(rows * COLUMNS);
      words.set(tables);
      bound.set(name, texture(gl.R32UI, COLUMNS, rows, gl.RED_INTEGER, gl.UNSIGNED_INT, words));
    }
    return bound.get(name);
  };
  const attach = (program, kind, source) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    gl.deleteShader(shader);
    return shader;
  };
  const compiled = async (wanted) => {
    const program = gl.createProgram();
    attach(program, gl.VERTEX_SHADER, VERTEX);
    const shader = attach(program, gl.FRAGMENT_SHADER, fragment(wanted));
    gl.linkProgram(program);
    while (parallel && !gl.getProgramParameter(program, parallel.COMPLETION_STATUS_KHR)) await soon();
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const why = gl.getShaderInfoLog(shader) || gl.getProgramInfoLog(program);
      throw gl.isContextLost() ? lost() : new Error(`the shader cannot be compiled: ${why}`);
    }
    const names = ["sums", "size", "number", "seeds", "mine_tables"];
    return { program, at: Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(program, name)])) };
  };
  const programFor = async (wanted) => {
    const made = programs.get(wanted.name) ?? await compiled(wanted);
    programs.delete(wanted.name);
    programs.set(wanted.name, made);
    for (const [name, { program }] of [...programs].slice(0, -MOST_PROGRAMS)) {
      gl.deleteProgram(program);
      programs.delete(name);
    }
    return made;
  };
  const finished = async () => {
    const [sync, before] = [gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0), times];
    gl.flush();
    for (;;) {
      await soon();
      if (gl.isContextLost() || times !== before) throw lost();
      if (gl.clientWaitSync(sync, 0, 0) !== gl.TIMEOUT_EXPIRED) return gl.deleteSync(sync);
    }
  };
  const draw = async ({ at, program: wanted, first, last }) => {
    const { program, at: uniforms } = await programFor(wanted);
    const pair = target(at);
    gl.useProgram(program);
    gl.uniform1i(uniforms.sums, 0);
    gl.uniform1i(uniforms.mine_tables, 1);
    gl.uniform1f(uniforms.size, 1 / side);
    gl.uniform1uiv(uniforms.seeds, wanted.seeds);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, tableTexture(wanted));
    gl.activeTexture(gl.TEXTURE0);
    const start = performance.now();
    for (let number = first; number < last; number++) {
      gl.uniform1ui(uniforms.number, number);
      gl.bindTexture(gl.TEXTURE_2D, pair[0].sums);
      gl.bindFramebuffer(gl.FRAMEBUFFER, pair[1].frame);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      pair.reverse();
    }
    await finished();
    return performance.now() - start;
  };
  const read = (at) => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, target(at)[0].frame);
    const texels = new Float32Array(4 * side * side);
    gl.readPixels(0, 0, side, side, gl.RGBA, gl.FLOAT, texels);
    if (gl.isContextLost()) throw lost();
    return texels.filter((_, k) => k % 4 === 0);
  };

  gl?.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  gl?.canvas.addEventListener("webglcontextrestored", reset);
  // What fails because the graphics card is lost is told as that.
  const guarded = (work) => async (given) => {
    try {
      return await work(given);
    } catch (error) {
      throw gl.isContextLost() ? lost() : error;
    }
  };
  return {
    gl,
    // Return whether there is WebGL 2 with targets of floats.
    open: (size) => {
      side = size;
      if (!gl?.getExtension("EXT_color_buffer_float")) return false;
      reset();
      return true;
    },
    compile: guarded(async (wanted) => { await programFor(wanted); }),
    // Add the samples from first to before last to the sums at a place, where sample 0 begins anew; return the
    // sums of all pixels, row by row, if they are asked for, and how many milliseconds it took.
    add: guarded(async (given) => {
      const took = await draw(given);
      return { took, sums: given.reading ? read(given.at) : null };
    }),
    restored: async () => { while (gl.isContextLost()) await soon(); },
  };
};
