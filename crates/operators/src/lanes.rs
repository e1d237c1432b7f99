//! Vector registers of either precision.

use pulp::{Arch, Simd, WithSimd};

/// Numbers that vector registers hold side by side.
pub trait Lanes: Copy {
    /// As many of them as there is room for.
    type Register<S: Simd>: Copy;

    /// The registers that a slice fills; what is left at the end is left out.
    fn registers<S: Simd>(values: &[Self]) -> &[Self::Register<S>];

    /// [`Self::registers`], to be written to.
    fn registers_mut<S: Simd>(values: &mut [Self]) -> &mut [Self::Register<S>];

    /// A register with one value throughout.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Register<S>;

    /// `a b + c`, rounded once where the processor does that in one instruction.
    fn multiply_add<S: Simd>(
        simd: S,
        a: Self::Register<S>,
        b: Self::Register<S>,
        c: Self::Register<S>,
    ) -> Self::Register<S>;
}

// What is not inlined is compiled without the instructions that were detected.
macro_rules! lanes {
    ($type:ty, $register:ident, $shared:ident, $exclusive:ident, $splat:ident, $multiply_add:ident) => {
        impl Lanes for $type {
            type Register<S: Simd> = S::$register;
            #[inline(always)]
            fn registers<S: Simd>(values: &[Self]) -> &[S::$register] {
                S::$shared(values).0
            }
            #[inline(always)]
            fn registers_mut<S: Simd>(values: &mut [Self]) -> &mut [S::$register] {
                S::$exclusive(values).0
            }
            #[inline(always)]
            fn splat<S: Simd>(simd: S, value: Self) -> S::$register {
                simd.$splat(value)
            }
            #[inline(always)]
            fn multiply_add<S: Simd>(
                simd: S,
                a: S::$register,
                b: S::$register,
                c: S::$register,
            ) -> S::$register {
                simd.$multiply_add(a, b, c)
            }
        }
    };
}

lanes!(
    f64,
    f64s,
    as_simd_f64s,
    as_mut_simd_f64s,
    splat_f64s,
    mul_add_e_f64s
);
lanes!(
    f32,
    f32s,
    as_simd_f32s,
    as_mut_simd_f32s,
    splat_f32s,
    mul_add_e_f32s
);

/// Whether the processor has the 32 registers of AVX-512, of which [`dispatch`] takes the width of AVX2.
pub(crate) fn has_more_registers(arch: Arch) -> bool {
    #[cfg(target_arch = "x86_64")]
    if matches!(arch, Arch::V3(_)) {
        return is_x86_feature_detected!("avx512vl") && is_x86_feature_detected!("avx512dq");
    }
    let _ = arch;
    false
}

/// Runs work with the best instructions that the processor has. Where that is AVX-512, registers are as wide as those of AVX2, and twice as many: results
/// are the same.
pub(crate) fn dispatch<W: WithSimd>(arch: Arch, work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if let Arch::V3(simd) = arch
        && has_more_registers(arch)
    {
        #[allow(unsafe_code, reason = "the compiler cannot know the processor")]
        // SAFETY: the processor has them.
        return unsafe { with_more_registers(simd, work) };
    }
    arch.dispatch(work)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx2,fma,bmi1,bmi2")]
fn with_more_registers<W: WithSimd>(simd: pulp::x86::V3, work: W) -> W::Output {
    work.with_simd(simd)
}
