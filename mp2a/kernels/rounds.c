/* The rounds of one rank, step after step, without the interpreter between them.

   mp2a.transport.native records the steps; mp2a/kernels/library.py links this with the compiled formulas. Nothing is
   included, not even mpi.h: MPI's two functions come as addresses, requests and statuses as memory that only MPI
   reads, so that one object serves any MPI. */

typedef long long integer;

/* In the order of STEPS in mp2a/kernels/__init__.py. */
enum { START, AWAIT, COMPOSE, TRANSFORM, TRANSFORM_FORCE, ADD, PRODUCT, PUSH };

struct step {
    integer what, count;
    double *arrays[4]; /* the result and the inputs; of START and AWAIT the requests */
};

struct program {
    struct step *steps;
    int (*startall)(int, void *);
    int (*testall)(int, void *, int *, void *);
    void *statuses;
    integer looks;  /* how often to look for messages before giving up */
    integer yields; /* whether to leave the processor to others between looks */
};

void mp2a_compose(integer, double **, double **, double **);
void mp2a_transform(integer, double **, double **, double **);
void mp2a_transform_force(integer, double **, double **, double **);
int sched_yield(void);

static void add(integer count, double *out, const double *part)
{
    for (integer i = 0; i < count; i++)
        out[i] += part[i];
}

/* out = a b, 6x6 matrices; out is neither of them. */
static void product(integer count, double *restrict out, const double *a, const double *b)
{
    for (; count > 0; count--, out += 36, a += 36, b += 36)
        for (int i = 0; i < 6; i++) {
            double row[6] = {0};
            for (int k = 0; k < 6; k++)
                for (int j = 0; j < 6; j++)
                    row[j] += a[6 * i + k] * b[6 * k + j];
            for (int j = 0; j < 6; j++)
                out[6 * i + j] = row[j];
        }
}

/* out = a x + y; out may be y. */
static void push(integer count, double *out, const double *a, const double *x, const double *y)
{
    for (; count > 0; count--, out += 6, a += 36, x += 6, y += 6)
        for (int i = 0; i < 6; i++) {
            double sum = 0;
            for (int k = 0; k < 6; k++)
                sum += a[6 * i + k] * x[k];
            out[i] = sum + y[i];
        }
}

/* Do the steps from first on. Returns last when done; the number of an AWAIT whose requests are not complete; or an
   error code of MPI, negated. */
integer mp2a_rounds(const struct program *program, integer first, integer last)
{
    for (integer at = first; at < last; at++) {
        struct step *step = program->steps + at;
        double **a = step->arrays;
        int error = 0, done = 0;
        switch (step->what) {
        case START:
            error = program->startall((int)step->count, a[0]);
            break;
        case AWAIT:
            for (integer look = 0; !error && !done; look++) {
                if (look == program->looks)
                    return at;
                if (look && program->yields)
                    sched_yield();
                error = program->testall((int)step->count, a[0], &done, program->statuses);
            }
            break;
        case COMPOSE: mp2a_compose(step->count, a, a + 1, a + 2); break;
        case TRANSFORM: mp2a_transform(step->count, a, a + 1, a + 2); break;
        case TRANSFORM_FORCE: mp2a_transform_force(step->count, a, a + 1, a + 2); break;
        case ADD: add(step->count, a[0], a[1]); break;
        case PRODUCT: product(step->count, a[0], a[1], a[2]); break;
        case PUSH: push(step->count, a[0], a[1], a[2], a[3]); break;
        }
        if (error)
            return -(integer)error;
    }
    return last;
}
