"""Source code in shaders: WGSL, HLSL, Slang and GLSL, run by wgpu with any driver."""

import ctypes
import shutil
import subprocess
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

GIVEN = {"sampler": 3, "sequence": 1, "order": 2, "check": 0}
"""Number of words that each kind of object is called with; a check returns one, as an order does."""

WGSL = """
@group(0) @binding(0) var<storage, read> given: array<u32>;
@group(0) @binding(1) var<storage, read_write> found: array<f32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x + 65536u * id.y;
    if (i >= @COUNT@u) { return; }
    @CALL@
    for (var k = 0u; k < @SIZE@u; k++) { found[@SIZE@u * i + k] = values[k]; }
}
"""
HLSL = """
[[vk::binding(0)]] StructuredBuffer<uint> given;
[[vk::binding(1)]] RWStructuredBuffer<float> found;
[numthreads(64, 1, 1)] void main(uint3 id : SV_DispatchThreadID) {
    uint i = id.x + 65536u * id.y;
    if (i >= @COUNT@u) return;
    float values[@SIZE@];
    @CALL@
    for (uint k = 0u; k < @SIZE@u; k++) found[@SIZE@u * i + k] = values[k];
}
"""

GLSL = """
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer Given { uint given[]; };
layout(set = 0, binding = 1) buffer Found { float found[]; };
void main() {
    uint i = gl_GlobalInvocationID.x + 65536u * gl_GlobalInvocationID.y;
    if (i >= @COUNT@u) return;
    float values[@SIZE@];
    @CALL@
    for (uint k = 0u; k < @SIZE@u; k++) found[@SIZE@u * i + k] = values[k];
}
"""
VERSION = "#version 310 es\nprecision highp float; precision highp int;\n"

CALLS = {
    WGSL: ("var values = mine({});", "var values = array<f32, 1>(bitcast<f32>(mine({})));"),
    HLSL: ("mine({}, values);", "values[0] = asfloat(mine({}));"),
    GLSL: ("mine({}, values);", "values[0] = uintBitsToFloat(mine({}));"),
}


def filled(program, text, kind, inputs, size):
    """Return a program that calls the function ``mine`` once for each entry of its inputs."""
    number = GIVEN[kind]
    words = [f"given[{number}u * i + {k}u]" for k in range(number)]
    words += ["mine_seeds"] * ("mine_seeds" in text)
    call = CALLS[program][kind == "order"].format(", ".join(words))
    if kind == "check":  # An argument that is not used would not be bound.
        check = f"{'u32' if program == WGSL else 'uint'}(mine_check()) + given[i]"
        call = CALLS[program][1].replace("mine({})", check)
    elif "mine_check" in text:  # A vector that is missed changes a result.
        call += " if (i == 0u && mine_check() != 0) { values[0] = 9.0; }"
    for word, value in (("COUNT", len(inputs[0])), ("SIZE", size), ("CALL", call)):
        program = program.replace(f"@{word}@", str(value))
    return type(text)(text + program, text.tables)


@cache
def device():
    """Return a device of wgpu, or why there is none."""
    try:
        import wgpu
    except ImportError:
        return "no wgpu: pip install wgpu"
    try:
        return wgpu.gpu.request_adapter_sync(power_preference="low-power").request_device_sync()
    except Exception as error:
        return f"no driver for wgpu (Debian: mesa-vulkan-drivers): {error}"


def missing(language):
    """Return why a language cannot be run, or None."""
    if isinstance(device(), str):
        return device()
    if language == "slang":
        return None if slang() else "no slangpy: pip install slangpy"
    compiler = language == "wgsl" or shutil.which("glslangValidator")
    return None if compiler else "no glslangValidator (Debian: glslang-tools)"


@cache
def slang():
    """Return the file of Slang's compiler, if slangpy is installed; it has 290 MB, and is no requirement."""
    found = find_spec("slangpy")
    return next(Path(found.origin).parent.glob("libslang-compiler.so*"), None) if found else None


def wgsl_of(text, folder):
    """Return what Slang's compiler makes of a program: WGSL, which is compiled in turn."""
    library = ctypes.CDLL(str(slang()))
    for name in ("spCreateSession", "spCreateCompileRequest", "spGetEntryPointCode"):
        getattr(library, name).restype = ctypes.c_void_p
    library.spGetDiagnosticOutput.restype = ctypes.c_char_p
    (folder / "mine.slang").write_text(text)
    options = ["-target", "wgsl", "-entry", "main", "-stage", "compute", str(folder / "mine.slang")]
    session = ctypes.c_void_p(library.spCreateSession(None))
    request = ctypes.c_void_p(library.spCreateCompileRequest(session))
    given = (ctypes.c_char_p * len(options))(*map(str.encode, options))
    failed = library.spProcessCommandLineArguments(request, given, len(options)) or library.spCompile(request)
    assert failed == 0, library.spGetDiagnosticOutput(request).decode()[:4000]
    size = ctypes.c_size_t()
    code = library.spGetEntryPointCode(request, 0, ctypes.byref(size))
    made = ctypes.string_at(code, size.value).decode()
    library.spDestroyCompileRequest(request)
    library.spDestroySession(session)
    return made


def run(language, text, kind, inputs, size, folder):
    """Return what a function makes of arrays, shape (n, size); GLSL without tables that are bound."""
    if language == "wgsl":
        return _run(str(filled(WGSL, text, kind, inputs, size)), text.tables, inputs, size, kind)
    if language == "slang":
        code = wgsl_of(filled(HLSL, text, kind, inputs, size), folder)
        return _run(code, text.tables, inputs, size, kind)
    program, first, options = (HLSL, "", ["-D"]) if language == "hlsl" else (GLSL, VERSION, [])
    (folder / "mine").write_text(first + filled(program, text, kind, inputs, size))
    options += ["-V", "-S", "comp", "-e", "main", "--quiet"]
    command = ["glslangValidator", *options, "-o", "mine.spv", "mine"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[:4000]
    return _run((folder / "mine.spv").read_bytes(), text.tables, inputs, size, kind)


def _run(code, tables, inputs, size, kind):
    import wgpu

    made, count = device(), len(inputs[0])
    words = np.stack(inputs, axis=-1).astype(np.uint32).tobytes()
    given = made.create_buffer_with_data(data=words, usage=wgpu.BufferUsage.STORAGE)
    usage = wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_SRC
    found = made.create_buffer(size=4 * count * size, usage=usage)
    compute = {"module": made.create_shader_module(code=code), "entry_point": "main"}
    pipeline = made.create_compute_pipeline(layout="auto", compute=compute)
    entries = [{"binding": k, "resource": {"buffer": buffer}} for k, buffer in enumerate((given, found))]
    groups = [(0, entries)]
    if tables.size:
        words = made.create_buffer_with_data(data=tables.tobytes(), usage=wgpu.BufferUsage.STORAGE)
        groups.append((1, [{"binding": 0, "resource": {"buffer": words}}]))
    encoder = made.create_command_encoder()
    pass_ = encoder.begin_compute_pass()
    pass_.set_pipeline(pipeline)
    for number, entries in groups:
        layout = pipeline.get_bind_group_layout(number)
        pass_.set_bind_group(number, made.create_bind_group(layout=layout, entries=entries))
    pass_.dispatch_workgroups(1024, -(-count // 65536))
    pass_.end()
    made.queue.submit([encoder.finish()])
    dtype = np.uint32 if kind in ("order", "check") else np.float32
    return np.frombuffer(made.queue.read_buffer(found), dtype).reshape(count, size)
