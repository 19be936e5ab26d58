// SPDX-License-Identifier: MIT
#include "posix/trajectory.h"

#include <inttypes.h>
#include <math.h>

/* The four squared components of the quaternion times four; the largest is taken as the pivot, so
 * that nothing is divided by a small number (Shepperd 1978). */
void rotation_quaternion(double q[4], const double R[9]) {
    const double trace = R[0] + R[4] + R[8];
    const double squares[4] = {1 + 2 * R[0] - trace, 1 + 2 * R[4] - trace, 1 + 2 * R[8] - trace,
                               1 + trace};
    int pivot = 0;
    for (int i = 1; i < 4; i++)
        if (squares[i] > squares[pivot])
            pivot = i;
    const double xy = R[1] + R[3], xz = R[2] + R[6], yz = R[5] + R[7];
    const double wx = R[7] - R[5], wy = R[2] - R[6], wz = R[3] - R[1];
    const double rows[4][4] = {{squares[0], xy, xz, wx},
                               {xy, squares[1], yz, wy},
                               {xz, yz, squares[2], wz},
                               {wx, wy, wz, squares[3]}};
    double norm = 0;
    for (int i = 0; i < 4; i++)
        norm += rows[pivot][i] * rows[pivot][i];
    const double scale = (rows[pivot][3] < 0 ? -1 : 1) / sqrt(norm);
    for (int i = 0; i < 4; i++)
        q[i] = rows[pivot][i] * scale;
}

/* Seconds without a rounding: a double holds no nanoseconds of this century. */
static void put_time(FILE *file, plr_time_ns t_ns) {
    fprintf(file, "%" PRIu64 ".%09" PRIu64, t_ns / 1000000000u, t_ns % 1000000000u);
}

void trajectory_put(FILE *file, const plr_pose_message *pose) {
    double q[4];
    if (file == NULL)
        return;
    rotation_quaternion(q, pose->T_WB.R);
    put_time(file, pose->t_ns);
    for (int i = 0; i < 3; i++)
        fprintf(file, " %.9g", pose->T_WB.p[i]);
    for (int i = 0; i < 4; i++)
        fprintf(file, " %.9g", q[i]);
    fputc('\n', file);
}

void frames_put_titles(FILE *file) {
    if (file == NULL)
        return;
    fputs("t_s,x_m,y_m,z_m,qx,qy,qz,qw,"
          "var_rho_x,var_rho_y,var_rho_z,var_theta_x,var_theta_y,var_theta_z,trace,"
          "vx_mps,vy_mps,vz_mps,wx_radps,wy_radps,wz_radps,"
          "bias_vx,bias_vy,bias_vz,bias_wx,bias_wy,bias_wz,"
          "var_bias_vx,var_bias_vy,var_bias_vz,var_bias_wx,var_bias_wy,var_bias_wz,"
          "status,health,reasons,budget,observations,matched,used,gated,new,evicted,refused,"
          "duplicates,no_room,poor,left_out,blocks_failed,active,nis,nis_dof,update_us\n",
          file);
}

static void put_numbers(FILE *file, const double *numbers, int n) {
    for (int i = 0; i < n; i++)
        fprintf(file, ",%.9g", numbers[i]);
}

static void put_nothing(FILE *file, int n) {
    for (int i = 0; i < n; i++)
        fputc(',', file);
}

enum { ESTIMATE_COLUMNS = 32 };

/* A filter that has diverged knows no variance: those columns are empty. */
static void put_estimate(FILE *file, const plr_pose_message *pose, double trace,
                         const double *bias_variance) {
    const bool known = pose->P_xi[0] < PLR_WIRE_UNKNOWN_VARIANCE;
    double q[4], variances[7];
    rotation_quaternion(q, pose->T_WB.R);
    for (int i = 0; i < 6; i++)
        variances[i] = pose->P_xi[i * (i + 3) / 2];
    variances[6] = trace;
    put_numbers(file, pose->T_WB.p, 3);
    put_numbers(file, q, 4);
    if (known)
        put_numbers(file, variances, 7);
    else
        put_nothing(file, 7);
    put_numbers(file, pose->velocity.v_B_mps, 3);
    put_numbers(file, pose->velocity.w_B_radps, 3);
    put_numbers(file, pose->bias, 6);
    if (known)
        put_numbers(file, bias_variance, 6);
    else
        put_nothing(file, 6);
}

static void put_report(FILE *file, const plr_report *r) {
    const unsigned counts[] = {
        r->observations, r->matched, r->used, r->gated,    r->created,       r->evicted, r->refused,
        r->duplicates,   r->no_room, r->poor, r->left_out, r->blocks_failed, r->active};
    fprintf(file, ",%d,%s,%u,%u", (int)r->status, plr_health_text(r->health), (unsigned)r->reasons,
            (unsigned)r->budget);
    for (unsigned i = 0; i < sizeof counts / sizeof counts[0]; i++)
        fprintf(file, ",%u", counts[i]);
    fprintf(file, ",%.7g,%u", (double)r->nis, (unsigned)r->nis_dof);
}

void frames_put(FILE *file, const plr_frame_result *result, double trace,
                const double *bias_variance) {
    if (file == NULL)
        return;
    put_time(file, result->frame->t_ns);
    if (result->pose != NULL)
        put_estimate(file, result->pose, trace, bias_variance);
    else
        put_nothing(file, ESTIMATE_COLUMNS);
    put_report(file, result->report);
    fprintf(file, ",%.3f\n", (double)result->compute_ns / 1e3);
}
