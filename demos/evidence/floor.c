/* The floor under a Newton step: the cheapest rod there is, in plain C. Planar, geometrically exact (Reissner), linear
   elements with one Gauss point, clamped at its start, a force across its end. A step: residual and tangent of every
   element, elimination from the start to the end without pivoting, back-substitution, update; one residual at the end.

       floor ELEMENTS STEPS        prints the microseconds of a step and the largest displacement after it */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MOST = 1000 };
static const double EA = 1e4, GA = 4e3, EI = 1.0, LOAD = 1e-6; /* length 1 */
static double x[MOST + 1][3], factors[MOST][3][7];             /* x, y, angle of the nodes */

/* Residual R and, if `both`, tangent K of the element from node i, of length h. */
static void element(int i, double h, int both, double R[6], double K[6][6])
{
    double c = cos((x[i][2] + x[i + 1][2]) / 2), s = sin((x[i][2] + x[i + 1][2]) / 2);
    double dx = (x[i + 1][0] - x[i][0]) / h, dy = (x[i + 1][1] - x[i][1]) / h;
    double stretch = c * dx + s * dy, g = c * dy - s * dx;
    double N = EA * (stretch - 1), Q = GA * g, M = EI * (x[i + 1][2] - x[i][2]) / h;
    double e1[6] = {-c / h, -s / h, g / 2, c / h, s / h, g / 2};
    double g1[6] = {s / h, -c / h, -stretch / 2, -s / h, c / h, -stretch / 2};
    double k1[6] = {0, 0, -1 / h, 0, 0, 1 / h};
    for (int a = 0; a < 6; a++) R[a] = h * (N * e1[a] + Q * g1[a] + M * k1[a]);
    if (!both) return;
    for (int a = 0; a < 6; a++)
        for (int b = 0; b < 6; b++) K[a][b] = h * (EA * e1[a] * e1[b] + GA * g1[a] * g1[b] + EI * k1[a] * k1[b]);
    double turn = -h * (N * stretch + Q * g) / 4, in_x = (N * s + Q * c) / 2, in_y = (Q * s - N * c) / 2;
    double mixed[6] = {in_x, in_y, 0, -in_x, -in_y, 0};
    for (int t = 2; t < 6; t += 3) {
        for (int a = 0; a < 6; a++) K[t][a] += mixed[a], K[a][t] += mixed[a];
        K[t][2] += turn, K[t][5] += turn;
    }
}

/* Eliminate the first three unknowns of F, whose last column is the right side. */
static void eliminate(double F[6][7])
{
    for (int k = 0; k < 3; k++)
        for (int a = k + 1; a < 6; a++) {
            double l = F[a][k] / F[k][k];
            for (int b = k + 1; b < 7; b++) F[a][b] -= l * F[k][b];
        }
}

static void newton_step(int n)
{
    double F[6][7], K[6][6], R[6], last[3] = {0}, h = 1.0 / n;
    for (int i = 0; i < n; i++) {
        double carried[3][4] = {{0}};
        for (int a = 0; a < 3 && i > 0; a++)
            for (int b = 0; b < 4; b++) carried[a][b] = F[a + 3][b + 3];
        element(i, h, 1, R, K);
        for (int a = 0; a < 6; a++) {
            memcpy(F[a], K[a], sizeof K[a]);
            F[a][6] = (i == n - 1 && a == 4 ? LOAD : 0) - R[a];
        }
        if (i == 0) continue; /* its start is clamped */
        for (int a = 0; a < 3; a++) {
            for (int b = 0; b < 3; b++) F[a][b] += carried[a][b];
            F[a][6] += carried[a][3];
        }
        eliminate(F);
        memcpy(factors[i], F, sizeof factors[i]);
    }
    double end[6][7] = {{0}};
    for (int a = 0; a < 3; a++) memcpy(end[a], F[a + 3] + 3, 3 * sizeof(double)), end[a][6] = F[a + 3][6];
    for (int i = n; i > 0; i--) { /* node i from its own three equations, known its right neighbour */
        double (*U)[7] = i == n ? end : factors[i], step[3];
        if (i == n)
            for (int k = 0; k < 3; k++)
                for (int a = k + 1; a < 3; a++) {
                    double l = U[a][k] / U[k][k];
                    for (int b = k + 1; b < 7; b++) U[a][b] -= l * U[k][b];
                }
        for (int a = 2; a >= 0; a--) {
            double right = U[a][6];
            for (int b = 0; b < 3; b++) right -= (i < n ? U[a][b + 3] * last[b] : 0);
            for (int b = a + 1; b < 3; b++) right -= U[a][b] * step[b];
            step[a] = right / U[a][a];
        }
        memcpy(last, step, sizeof step);
        for (int a = 0; a < 3; a++) x[i][a] += step[a];
    }
    double norm = 0;
    for (int i = 0; i < n; i++) {
        element(i, h, 0, R, K);
        for (int a = 0; a < 6; a++) norm += R[a] * R[a];
    }
    x[0][0] = norm < 1e300 ? 0 : norm; /* so that the compiler leaves nothing out */
}

int main(int count, char **words)
{
    int n = count == 3 ? atoi(words[1]) : 0, steps = count == 3 ? atoi(words[2]) : 0;
    if (n < 2 || n > MOST || steps < 1) return 1;
    static double rest[MOST + 1][3];
    for (int i = 0; i <= n; i++) rest[i][0] = (double)i / n;
    clock_t began = clock();
    for (int i = 0; i < steps; i++) {
        memcpy(x, rest, (n + 1) * sizeof *x);
        newton_step(n);
    }
    printf("%.6f %.12e\n", 1e6 * (double)(clock() - began) / CLOCKS_PER_SEC / steps, x[n][1]);
    return 0;
}
