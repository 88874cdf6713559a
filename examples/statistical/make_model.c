/* Example for the shape `statistical`: writes a synthetic point-distribution model (mean.ply,
 * modes.npy, deviations.npy) to a folder.
 *
 *     cc -O2 -o make_model make_model.c -lm && ./make_model .
 *
 * The mean is a rounded blob. The modes are smooth displacement fields (swelling, stretching,
 * bending, pear, twist, sideways bending, taper, bulging), orthonormalised like the result of a
 * principal component analysis of aligned meshes. To use your own analysis, replace them by
 * modes[n_modes][n_vert][3] of norm 1 and the standard deviation along each mode in mm. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define RINGS 23
#define SECTORS 36
#define N_VERT (RINGS * SECTORS + 2)
#define N_TRI (2 * RINGS * SECTORS)
#define N_MODES 8

static double mean[N_VERT][3], modes[N_MODES][N_VERT][3], deviations[N_MODES];
static uint32_t tri[N_TRI][3];

static void make_vertices(void)
{
    for (int v = 0; v < N_VERT; v++) {
        const int ring = v == 0 ? 0 : v == N_VERT - 1 ? RINGS + 1 : 1 + (v - 1) / SECTORS;
        const double down = PI * ring / (RINGS + 1), round = 2 * PI * ((v - 1) % SECTORS) / SECTORS;
        const double across = ring == 0 || ring == RINGS + 1 ? 0 : sin(down);
        const double x = across * cos(round), y = across * sin(round), z = -cos(down);
        const double swell = 1 + 0.12 * x * x * x - 0.1 * y * z; // breaks all symmetries
        mean[v][0] = 3.6 * swell * x;
        mean[v][1] = 2.8 * swell * y;
        mean[v][2] = 2.2 * swell * z;
    }
}

static void make_triangles(void)
{
    uint32_t(*t)[3] = tri;
    const uint32_t last = 1 + (RINGS - 1) * SECTORS;
    for (uint32_t j = 0; j < SECTORS; j++) {
        const uint32_t k = (j + 1) % SECTORS;
        memcpy(*t++, (uint32_t[3]){0, 1 + k, 1 + j}, sizeof *t);
        memcpy(*t++, (uint32_t[3]){last + j, last + k, N_VERT - 1}, sizeof *t);
        for (uint32_t low = 1; low < last; low += SECTORS) {
            memcpy(*t++, (uint32_t[3]){low + j, low + k, low + SECTORS + k}, sizeof *t);
            memcpy(*t++, (uint32_t[3]){low + j, low + SECTORS + k, low + SECTORS + j}, sizeof *t);
        }
    }
}

static double dot(int i, int j)
{
    double sum = 0;
    for (int v = 0; v < N_VERT; v++)
        for (int k = 0; k < 3; k++) sum += modes[i][v][k] * modes[j][v][k];
    return sum;
}

static void make_modes(void)
{
    for (int v = 0; v < N_VERT; v++) {
        const double x = mean[v][0] / 3.6, y = mean[v][1] / 2.8, z = mean[v][2] / 2.2;
        const double field[N_MODES][3] = {
            {x, y, z},          {x, -0.5 * y, -0.5 * z}, {0, 0, x * x},     {0, y * x, z * x},
            {0, -z * x, y * x}, {0, x * x, 0},           {x * z, y * z, 0}, {z * z, 0, 0}};
        for (int i = 0; i < N_MODES; i++) memcpy(modes[i][v], field[i], sizeof field[i]);
    }
    // Gram-Schmidt orthonormalisation, done twice because of rounding errors
    for (int i = 0; i < N_MODES; i++) {
        for (int j = 0; j < 2 * i; j++) {
            const double share = dot(i, j % i);
            for (int v = 0; v < N_VERT; v++)
                for (int k = 0; k < 3; k++) modes[i][v][k] -= share * modes[j % i][v][k];
        }
        const double length = sqrt(dot(i, i));
        for (int v = 0; v < N_VERT; v++)
            for (int k = 0; k < 3; k++) modes[i][v][k] /= length;
        // root mean square displacement over the vertices: 0.25 mm for the first mode, less for
        // others
        deviations[i] = 0.25 * pow(0.75, i) * sqrt(N_VERT);
    }
}

static FILE *create(const char *folder, const char *name)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "wb");
    if (!f) {
        perror(path);
        exit(1);
    }
    return f;
}

static void finish(FILE *f)
{
    const int failed = ferror(f);
    if (fclose(f) || failed) {
        perror("writing");
        exit(1);
    }
}

static void write_ply(const char *folder)
{
    FILE *f = create(folder, "mean.ply");
    fprintf(f,
            "ply\nformat ascii 1.0\nelement vertex %d\nproperty double x\nproperty double "
            "y\nproperty double z\n",
            N_VERT);
    fprintf(f, "element face %d\nproperty list uchar int vertex_indices\nend_header\n", N_TRI);
    for (int v = 0; v < N_VERT; v++)
        fprintf(f, "%.17g %.17g %.17g\n", mean[v][0], mean[v][1], mean[v][2]);
    for (int t = 0; t < N_TRI; t++)
        fprintf(f, "3 %u %u %u\n", (unsigned)tri[t][0], (unsigned)tri[t][1], (unsigned)tri[t][2]);
    finish(f);
}

/* .npy format version 1.0, header of 128 bytes (a multiple of 64). For little-endian machines
 * only. */
static void write_npy(const char *folder, const char *name, const char *shape, const double *values,
                      size_t count)
{
    char header[128];
    memset(header, ' ', sizeof header);
    memcpy(header, "\x93NUMPY\x01\x00\x76\x00", 10);
    const int n = snprintf(header + 10, sizeof header - 10,
                           "{'descr': '<f8', 'fortran_order': False, 'shape': (%s), }", shape);
    header[10 + n] = ' ';
    header[127] = '\n';
    FILE *f = create(folder, name);
    fwrite(header, 1, sizeof header, f);
    fwrite(values, sizeof *values, count, f);
    finish(f);
}

int main(int argc, char **argv)
{
    const char *folder = argc > 1 ? argv[1] : ".";
    make_vertices();
    make_triangles();
    make_modes();
    char shape[64];
    snprintf(shape, sizeof shape, "%d, %d, 3", N_MODES, N_VERT);
    write_ply(folder);
    write_npy(folder, "modes.npy", shape, modes[0][0], sizeof modes / sizeof(double));
    snprintf(shape, sizeof shape, "%d,", N_MODES);
    write_npy(folder, "deviations.npy", shape, deviations, N_MODES);
    printf("%s: mean.ply of %d vertices, modes.npy and deviations.npy of %d modes\n", folder,
           N_VERT, N_MODES);
    return 0;
}
