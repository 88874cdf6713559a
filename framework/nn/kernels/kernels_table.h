/* The table of functions that each instruction set provides. Each of kernels_*.c compiles the same
   source, kernels_simd.h, for one instruction set. Contracts: sdm/internal/kernels.h. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/kernels.h"

typedef struct kernel_table {
    const char *name;
    /* Computes a block of sdm_gemm() in the calling thread. */
    void (*product)(size_t m, size_t n, size_t k, sdm_view a, sdm_view b, bool add, float *c,
                    size_t ldc);
    /* Implement sdm_panel_*() and sdm_panel_back_*(). `outputs` is a multiple of SDM_PANEL. */
    void (*panel_f32)(size_t batch, size_t outputs, size_t k, const float *w, const float *x,
                      size_t ldx, float *y, size_t ldy);
    void (*panel_f16)(size_t batch, size_t outputs, size_t k, const uint16_t *w, const float *x,
                      size_t ldx, float *y, size_t ldy);
    void (*back_f32)(size_t outputs, size_t k, const float *w, const float *y, float *x);
    void (*back_f16)(size_t outputs, size_t k, const uint16_t *w, const float *y, float *x);
    /* Implement sdm_panel_i8*(), sdm_panel_back_i8() and sdm_quantise*(). `outputs` is a multiple
       of SDM_PANEL. */
    void (*panel_i8)(size_t batch, size_t outputs, size_t n_wide, size_t k, const int8_t *w,
                     const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to);
    void (*panel_i8_blocks)(size_t batch, size_t n, const sdm_panel_block *blocks, const int8_t *w,
                            const int16_t *x, size_t ldx, const float *scale,
                            const sdm_panel_out *to);
    void (*back_i8)(size_t outputs, size_t n_wide, size_t k, const int8_t *w, const float *y,
                    float *x);
    void (*quantise)(size_t rows, size_t n, const float *y, size_t ldy, const float *factor,
                     int limit, int16_t *x, size_t ldx, float *scale);
    void (*quantise_residual)(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                              float *scale, int16_t *residual, float *residual_scale);
    /* Implement sdm_copy() and sdm_exp(). */
    void (*copy_floats)(size_t n, const float *y, float *to, bool stream);
    void (*exp)(size_t n, const float *x, float *y);
} kernel_table;

extern const kernel_table sdm_kernels_generic;
#if defined(__x86_64__)
extern const kernel_table sdm_kernels_avx2, sdm_kernels_avx512, sdm_kernels_avx512vnni;
#endif
