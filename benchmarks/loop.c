/* The closed loop of simbench/loop/kernel.py in C: Choudhury valve, PI, first-order plant with two delay taps. */
#include <math.h>
#include <stddef.h>

static double clip(double x, double lo, double hi) { return x < lo ? lo : (x > hi ? hi : x); }

/* w has n + lag entries, the first lag of them the past; all arrays are the caller's. */
void closed_loop(ptrdiff_t n, ptrdiff_t lag, const double *sp, const double *load_in, const double *load_out,
                 const double *noise, double op0, double *w, double a, double b_old, double b_new, double pv0,
                 double Kc, double Ki, double S, double J, double *op, double *pv, double *mv)
{
    double x = 0.0, u = op0, e_prev = 0.0;
    double v = clip(op0, 0.0, 100.0), d = 0.0, u_prev = v;
    int moving = 0;
    for (ptrdiff_t k = 0; k < n; k++) {
        double y = (pv0 + x + load_out[k]) + noise[k];
        double e = sp[k] - y;
        u = clip(u + (Kc * (e - e_prev) + Ki * e), 0.0, 100.0);
        e_prev = e;
        double o = clip(u, 0.0, 100.0);
        if (!moving || (o - u_prev) * d <= 0.0) {
            moving = 0;
            if (o - v > 0.5 * (S + J)) { d = 1.0; moving = 1; }
            else if (o - v < -0.5 * (S + J)) { d = -1.0; moving = 1; }
        }
        if (moving) v = clip(o - d * 0.5 * (S - J), 0.0, 100.0);
        u_prev = o;
        w[k + lag] = v - op0 + load_in[k];
        x = a * x + (b_old * w[k] + b_new * w[k + 1]);
        pv[k] = y;
        op[k] = u;
        mv[k] = v;
    }
}
