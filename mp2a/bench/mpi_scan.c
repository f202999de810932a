/* Inverse dynamics of a serial chain of revolute joints by MPI's own scan, one rank a body: what MPI offers without mp2a.

   The motion of all bodies is one MPI_Scan with an operator of our own: segments of the chain (placement, velocity and
   acceleration across it) are composed. It also says where each body is, so forces are taken to the base's frame, and
   what hangs on a joint is a plain sum there: one MPI_Scan with MPI_SUM on the communicator in reversed order.

   Spatial vectors are [angular; linear], accelerations are spatial ones, and the base accelerates against gravity. */

#include <math.h>
#include <mpi.h>
#include <stdlib.h>

typedef double Vector[3];
typedef double Matrix[9];

/* From a body, or what it hangs on, to another body further out. */
typedef struct {
    Matrix rotation;    /* coordinates of the inner frame to those of the outer */
    Vector translation; /* outer origin in the inner frame, m */
    Vector velocity[2], acceleration[2]; /* of the outer body if the inner one is at rest, in the outer frame */
} Segment;

typedef struct {
    Matrix rotation;    /* joint at rest: coordinates of the body to those of its parent */
    Vector translation; /* joint in the parent's frame, m */
    Vector axis;
    double mass;
    Vector lever;       /* mass times centre of mass, kg m */
    Matrix inertia;     /* about the body's origin, kg m² */
    Vector gravity;     /* what the base is in, on the first rank; zero on the others, m/s² */
} Body;

typedef struct {
    Body body;
    MPI_Comm outwards, inwards;
    MPI_Datatype segment;
    MPI_Op compose;
    int capacity; /* samples that there is room for */
    Segment *segments;
    Vector (*forces)[2];
} Formation;

static void cross(const Vector a, const Vector b, Vector out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static void apply(const Matrix m, const Vector x, Vector out) {
    for (int i = 0; i < 3; i++) out[i] = m[3 * i] * x[0] + m[3 * i + 1] * x[1] + m[3 * i + 2] * x[2];
}

static void apply_transposed(const Matrix m, const Vector x, Vector out) {
    for (int i = 0; i < 3; i++) out[i] = m[i] * x[0] + m[3 + i] * x[1] + m[6 + i] * x[2];
}

static void multiply(const Matrix a, const Matrix b, Matrix out) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

/* Take a motion of the inner frame to the outer one. */
static void move(const Segment *across, const Vector motion[2], Vector out[2]) {
    Vector turning, linear;
    cross(across->translation, motion[0], turning);
    for (int i = 0; i < 3; i++) linear[i] = motion[1][i] - turning[i];
    apply(across->rotation, motion[0], out[0]);
    apply(across->rotation, linear, out[1]);
}

/* The user operator: `outer` becomes the segment from the beginning of `inner` to its own end. */
static void compose_one(const Segment *inner, Segment *outer) {
    Segment out;
    Vector offset, velocity[2], acceleration[2], product[3];
    multiply(outer->rotation, inner->rotation, out.rotation);
    apply_transposed(inner->rotation, outer->translation, offset);
    move(outer, inner->velocity, velocity);
    move(outer, inner->acceleration, acceleration);
    cross(velocity[0], outer->velocity[0], product[0]);
    cross(velocity[0], outer->velocity[1], product[1]);
    cross(velocity[1], outer->velocity[0], product[2]);
    for (int i = 0; i < 3; i++) {
        out.translation[i] = inner->translation[i] + offset[i];
        out.velocity[0][i] = velocity[0][i] + outer->velocity[0][i];
        out.velocity[1][i] = velocity[1][i] + outer->velocity[1][i];
        out.acceleration[0][i] = acceleration[0][i] + outer->acceleration[0][i] + product[0][i];
        out.acceleration[1][i] = acceleration[1][i] + outer->acceleration[1][i] + product[1][i] + product[2][i];
    }
    *outer = out;
}

static void compose(void *inner, void *outer, int *count, MPI_Datatype *type) {
    (void)type;
    for (int k = 0; k < *count; k++) compose_one((Segment *)inner + k, (Segment *)outer + k);
}

/* The segment across the body's own joint, whose angle q, rate v and acceleration a are given. */
static Segment joint_segment(const Body *body, double q, double v, double a) {
    const double *n = body->axis, s = sin(q), c = cos(q), t = 1 - c;
    const Matrix turn_back = {
        t * n[0] * n[0] + c, t * n[0] * n[1] + s * n[2], t * n[0] * n[2] - s * n[1],
        t * n[1] * n[0] - s * n[2], t * n[1] * n[1] + c, t * n[1] * n[2] + s * n[0],
        t * n[2] * n[0] + s * n[1], t * n[2] * n[1] - s * n[0], t * n[2] * n[2] + c,
    };
    Segment out;
    Vector fall[2];
    const Vector rise[2] = {{0, 0, 0}, {-body->gravity[0], -body->gravity[1], -body->gravity[2]}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            out.rotation[3 * i + j] = turn_back[3 * i] * body->rotation[3 * j] +
                                      turn_back[3 * i + 1] * body->rotation[3 * j + 1] +
                                      turn_back[3 * i + 2] * body->rotation[3 * j + 2];
        out.translation[i] = body->translation[i];
    }
    move(&out, rise, fall);
    for (int i = 0; i < 3; i++) {
        out.velocity[0][i] = v * n[i];
        out.velocity[1][i] = 0;
        out.acceleration[0][i] = a * n[i] + fall[0][i];
        out.acceleration[1][i] = fall[1][i];
    }
    return out;
}

/* The wrench that moves the body as it moves, in the base's frame about the base's origin. */
static void body_force(const Body *body, const Segment *path, Vector out[2]) {
    const double *w = path->velocity[0], *v = path->velocity[1];
    const double *dw = path->acceleration[0], *dv = path->acceleration[1];
    Vector spin, push, lever_v, w_lever, lever_dv, dw_lever, torque, force, product[3];
    apply(body->inertia, w, spin);
    cross(body->lever, v, lever_v);
    cross(w, body->lever, w_lever);
    for (int i = 0; i < 3; i++) {
        spin[i] += lever_v[i];
        push[i] = body->mass * v[i] + w_lever[i];
    }
    apply(body->inertia, dw, torque);
    cross(body->lever, dv, lever_dv);
    cross(dw, body->lever, dw_lever);
    cross(w, spin, product[0]);
    cross(v, push, product[1]);
    cross(w, push, product[2]);
    for (int i = 0; i < 3; i++) {
        torque[i] += lever_dv[i] + product[0][i] + product[1][i];
        force[i] = body->mass * dv[i] + dw_lever[i] + product[2][i];
    }
    Vector moment;
    apply_transposed(path->rotation, torque, out[0]);
    apply_transposed(path->rotation, force, out[1]);
    cross(path->translation, out[1], moment);
    for (int i = 0; i < 3; i++) out[0][i] += moment[i];
}

/* What a wrench in the base's frame is about the body's joint. */
static double joint_torque(const Body *body, const Segment *path, const Vector wrench[2]) {
    Vector moment, torque;
    cross(path->translation, wrench[1], moment);
    for (int i = 0; i < 3; i++) moment[i] = wrench[0][i] - moment[i];
    apply(path->rotation, moment, torque);
    return body->axis[0] * torque[0] + body->axis[1] * torque[1] + body->axis[2] * torque[2];
}

/* Set a control variable of this MPI that is a whole number, and leave in `value` what it was; whether it has one of
   that name that can be set. */
int mp2a_scan_swap(const char *variable, int *value) {
    int provided, index, count, before, done = 0;
    MPI_T_cvar_handle handle;
    if (MPI_T_init_thread(MPI_THREAD_SINGLE, &provided)) return 0;
    if (!MPI_T_cvar_get_index(variable, &index) && !MPI_T_cvar_handle_alloc(index, NULL, &handle, &count)) {
        done = !MPI_T_cvar_read(handle, &before) && !MPI_T_cvar_write(handle, value);
        if (done) *value = before;
        MPI_T_cvar_handle_free(&handle);
    }
    MPI_T_finalize();
    return done;
}

/* Collective over `comm`, which is given by its address: what a handle is differs between MPIs. */
Formation *mp2a_scan_open(MPI_Comm *comm, const Body *body) {
    Formation *self = calloc(1, sizeof *self);
    int rank;
    self->body = *body;
    MPI_Comm_rank(*comm, &rank);
    MPI_Comm_dup(*comm, &self->outwards);
    MPI_Comm_split(*comm, 0, -rank, &self->inwards);
    MPI_Type_contiguous(sizeof(Segment) / sizeof(double), MPI_DOUBLE, &self->segment);
    MPI_Type_commit(&self->segment);
    MPI_Op_create(compose, 0, &self->compose);
    return self;
}

/* Collective: torques from q, v and a of this rank's joint, all of as many samples; 0, or MPI's error. Each is given by
   the address of the pointer to its numbers, which an array of numpy has at hand. */
int mp2a_scan_rnea(Formation *self, int samples, double **q, double **v, double **a, double **torque) {
    if (samples > self->capacity) {
        free(self->segments);
        free(self->forces);
        self->segments = malloc(samples * sizeof *self->segments);
        self->forces = malloc(samples * sizeof *self->forces);
        self->capacity = samples;
    }
    Segment *path = self->segments;
    for (int k = 0; k < samples; k++) path[k] = joint_segment(&self->body, (*q)[k], (*v)[k], (*a)[k]);
    int error = MPI_Scan(MPI_IN_PLACE, path, samples, self->segment, self->compose, self->outwards);
    for (int k = 0; k < samples; k++) body_force(&self->body, path + k, self->forces[k]);
    error |= MPI_Scan(MPI_IN_PLACE, self->forces, 6 * samples, MPI_DOUBLE, MPI_SUM, self->inwards);
    for (int k = 0; k < samples; k++) (*torque)[k] = joint_torque(&self->body, path + k, self->forces[k]);
    return error;
}

/* Collective. */
void mp2a_scan_close(Formation *self) {
    MPI_Op_free(&self->compose);
    MPI_Type_free(&self->segment);
    MPI_Comm_free(&self->inwards);
    MPI_Comm_free(&self->outwards);
    free(self->forces);
    free(self->segments);
    free(self);
}
