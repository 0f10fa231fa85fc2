"""Reserved names of the languages, from their standards and the headers that the text includes.

Patterns match names that differ by a type or a size. Names with a leading underscore, or two consecutive
ones, are rejected earlier.
"""

import re

_NUMERIC = """
    abs acos all any asin atan atan2 ceil clamp cos cosh cross degrees determinant distance dot exp exp2 fma
    faceforward floor fmod frexp ldexp length log log2 max min mix modf normalize not pow radians reflect
    refract round sign sin sinh smoothstep sqrt step tan tanh transpose trunc
"""
_SPELLED = """
    auto bool break case char const continue default do double else enum extern false float for goto if
    inline int long register return short signed sizeof static struct switch true typedef union unsigned
    void volatile while
"""
_C = r"""
    alignas alignof asm constexpr fortran main nullptr restrict static_assert thread_local typeof
    typeof_unqual NULL i386 linux unix
    (offset|size|ptrdiff|wchar|max_align|nullptr|float|double|errno|rsize)_t
    u?int((_fast|_least)?(8|16|32|64)|ptr|max)_t (U?INT|PTRDIFF|SIZE|SIG_ATOMIC|WCHAR|WINT)(\d|_|[A-Z])*
    (mem|str|wcs)[a-z]\w* (stpn?cpy|locale_t|basename|rawmemchr|sig\w+_np) b(cmp|copy|zero) r?index
    ffs(l|ll)? explicit_bzero swab (a?(cos|sin|tan)(h|pi)? atan2(pi)? ldexp frexp modf scalb(n|ln)? nan fmod
    fma drem remquo remainder (exp|exp2|exp10)(m1)? expm1 log(p1|1p|10p1|2p1|10|2|b)? [il]?logb llogb
    pow(n|r|10)? compoundn rootn r?sqrt cbrt hypot erfc? [lt]?gamma ceil floor trunc round(even)? rint
    nearbyint l{1,2}(rint|round) u?fromfpx? fabs copysign fdim f(max|min)(imum(_mag)?(_num)?|mag)?
    next(after|toward|up|down) canonicalize sincos ([fd]|f(32|64)x?)?(add|sub|mul|div|fma|sqrt)l?
    significand finite j[01n] y[01n] totalorder(mag)? getpayload
    setpayload(sig)?)(f|l|f16|f32x?|f64x?|f128x?|d32|d64|d128)?(_r)? (l{0,2})(abs|div)
    is(finite|inf|nan|normal|zero|subnormal|signaling|canonical|eqsig)[fl]? signbit signgam
    is(greater|less)(equal|greater)? isunordered iseqsig issignaling fpclassify math_errhandling matherr
    (M|FP|MATH|HUGE)_\w+ NAN INFINITY SNAN\w* DEC_\w+ MAXFLOAT
"""
_CPP = r"""
    and(_eq)? bit(and|or) catch char(8|16|32)_t class compl concept consteval constinit (const|dynamic)_cast
    co_(await|return|yield) contract_assert decltype delete explicit export final friend import module
    mutable namespace new noexcept not(_eq)? operator x?or(_eq)? override private protected public
    (reinterpret|static)_cast reflexpr requires std template this throw try type(id|name) using virtual
    wchar_t
"""
_RESERVED = {
    "C": _SPELLED + _C,
    "C++": _SPELLED + _C + _CPP,
    "CUDA": _SPELLED
    + _C
    + _CPP
    + r"""
        (block|thread)Idx (block|grid)Dim warpSize dim3 cuda\w* half2?
        (make_)?(u?(char|short|int|long|longlong)|float|double|half)[1-4] atomic[A-Z]\w* tex(ture|[123]D\w*)
        tex(Cubemap|Layered)\w* surf(ace|[123]D\w*|Cubemap\w*) clock(64)? printf malloc free assert abort
        trap (u|ll|ull)?(min|max)
        (rcbrt|rhypot|r?norm([34]d)?|normcdf(inv)?|erf(inv|cinv|cx)|cyl_bessel_i[01])f? sincospif?
    """,
    "GLSL": _NUMERIC
    + r"""
        active asm atomic(_uint|[A-Z]\w*) attribute barrier bit(Count|field\w+) buffer cast centroid class
        coherent common const discard dFd[xy]\w* (Emit|End)\w+ equal external fi(lter|xed|nd[LM]SB) flat
        float(BitsTo\w+) fract fwidth\w* [biudhf]?vec[234] d?mat[234](x[234])?
        [iu]?(sampler|image|texture|subpassInput)([123]D|Cube|Buffer|MS)\w* gl_\w+ goto
        (greater|less)Than(Equal)? groupMemoryBarrier half highp in inout input interface interpolateAt\w+
        [iu]mulExtended uaddCarry usubBorrow u?int(BitsToFloat)? inverse(sqrt)? invariant is(inf|nan) layout
        lowp matrixCompMult mediump memoryBarrier\w* mod namespace noinline noise[1-4] noperspective
        notEqual out outerProduct output (un)?pack(Unorm|Snorm|Half|Double)\w+ part(ition) patch
        precis(e|ion) public readonly resource restrict roundEven sample sampler shared smooth
        subpass(Input|Load) subroutine superp template texelFetch\w* texture([A-Z]\w*)? this typedef uniform
        using varying writeonly image[A-Z]\w* a(cos|sin|tan)h exp log
    """
    + _SPELLED,
    "WGSL": _NUMERIC
    + r"""
        alias array(Length)? as(m(_fragment)?|ync)? abstract active alignas alignof attribute auto await
        atomic([A-Z]\w*)? become bitcast bool break case cast catch class co_(await|return|yield) coherent
        column_major common compile(_fragment)? concept const(_assert|_cast|eval|expr|init)? continu(e|ing)
        count(One|Leading|Trailing)\w+ crate debugger decltype default delete demote(_to_helper)? diagnostic
        discard do dpd[xy]\w* dot4\w+ (dynamic|reinterpret|static)_cast else enable enum explicit export
        extends extern external extractBits fallthrough false f16 f32 fi(lter|nal|nally) firstLeading\w+
        firstTrailing\w+ fn for fract friend from function fwidth\w* fxgroup get goto groupshared highp i32
        if impl(ements)? import inline insertBits instanceof interface inverseSqrt layout let loop lowp
        macro(_rules)? match mat[234]x[234][fh]? mediump meta mod(ule)? move mut(able)? namespace new ni?ll?
        nil NULL noexcept noinline nointerpolation non_?coherent noperspective null(ptr)? of operator
        override pa(ckage|ckoffset) (un)?pack[24]x\w+ partition pass patch pixelfragment precis(e|ion)
        premerge priv(ate)? protected ptr pub(lic)? quantizeToF16 quad[A-Z]\w* read(_write|only)? ref
        regardless register requires? resource restrict return reverseBits sampler(_comparison)? saturate
        select [Ss]elf set shared sizeof smooth snorm static(_assert)? std storage(Barrier)? struct
        subgroup[A-Z]\w* subroutine super switch target template texture(_\w+|[A-Z]\w*)? this thread_local
        throw trait true try type(def|id|name|of)? u32 uniform union unless unorm unsafe unsized use using
        var varying vec[234][fhiu]? virtual volatile wgsl where while with workgroup([A-Z]\w*)? write(only)?
        yield a(cos|sin|tan)h
    """,
    "HLSL": _NUMERIC
    + r"""
        (AllMemory|DeviceMemory|GroupMemory)Barrier\w* (Append|Consume)StructuredBuffer
        as(double|float|u?int\w*|m(_fragment)?) BlendState (RW)?(ByteAddress|Structured)?Buffer catch
        [ct]buffer centroid class cl(ip|amp) column_major compile(_fragment)? \w+Shader(Stream)?
        (const|dynamic|reinterpret|static)_cast countbits dd[xy]\w* delete DepthStencil\w+ discard dst dword
        errorf Evaluate\w+ explicit export f16tof32 f32tof16 firstbit\w+ frac friend fwidth fxgroup
        Gather\w* globallycoherent groupshared (Input|Output)Patch inout in out interface Interlocked\w+
        is(finite|inf|nan) lerp line(ar|adj)? (Line|Point|Triangle)Stream lit log10 mad matrix msad4 mul
        mutable namespace new noise nointerpolation noperspective NULL operator packoffset pass
        pixelfragment point precise printf private Process\w+ protected public rcp RasterizerState
        RenderTargetView reversebits row_major rsqrt
        (bool|half|dword|string|double|u?int(16|32|64)?(_t)?|float(16|32|64)?(_t)?|min(16|10)float|min(16|12)u?int)([1-4](x[1-4])?)?
        sample(r|r[123]D|rCUBE|r_state)? Sampler(Comparison)?State saturate shared sincos snorm
        stateblock(_state)? string technique(10|11)? template tex([123]D|CUBE)\w* texture([123]D|CUBE)?
        (RW|FeedBack|RasterizerOrdered)?Texture\w+ this throw triangle(adj)? try typename uniform unorm
        using vector vertexfragment virtual Wave\w+ Quad\w+ unsigned
    """
    + _SPELLED,
}
_RESERVED |= {
    "Metal": _SPELLED
    + _CPP
    + _NUMERIC
    + r"""
        as_type (bool|u?char|u?short|u?int|u?long|half|float|bfloat)([234](x[234])?)? u?int(8|16|32|64)_t
        access array(_ref)? atomic\w* constant constexpr (depth|texture|sampler|visible|intersection)\w*
        device fragment fmod fract kernel metal object_data packed_\w+ popcount rsqrt reverse_bits rint
        saturate select simd\w* size_t thread(group\w*|s_per\w+)? uint vec vertex quad\w* mesh ray_data main
    """,
    "Rust": r"""
        abstract as async await become box break const continue crate do dyn else enum extern false final fn
        for gen if impl in let loop macro match mod move mut override priv pub ref return [Ss]elf static
        struct super trait true try type typeof union unsafe unsized use virtual where while yield main
    """,
}
_RESERVED["Slang"] = (
    _RESERVED["HLSL"]
    + r"""
    associatedtype bwd_diff each enum expand extension func fwd_diff get implementing import is let module
    no_diff none operator property require set some spirv_asm This Tuple Optional ParameterBlock
    ConstantBuffer RaytracingAccelerationStructure uint var where
"""
)
_PATTERNS = {language: re.compile("|".join(words.split())) for language, words in _RESERVED.items()}


def reserving(name: str) -> list[str]:
    """Return the languages that reserve a name."""
    return [language for language, words in _PATTERNS.items() if words.fullmatch(name)]
