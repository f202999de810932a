/* Threads that share the pieces of a job, without the interpreter: who has just worked looks out for the next job for a
   while, since waking a thread takes longer than many a job.

   mp2a/kernels/thread_pool.py keeps the crew; mp2a/kernels/library.py links this with the compiled kernels. */

typedef long long integer;

struct crew {
    integer open;   /* whether there is a job to take pieces of */
    integer active; /* threads that look at the job just now */
    integer next, pieces, chunks, threads; /* chunks: of the one job; 0: every piece is a job of one chunk */
    integer looks; /* how often to look out for the next job */
    void (*kernel)(integer, integer, integer, integer, integer);
    integer verdict;
    /* Addresses of pointers: to each piece's job and its memory; else to the job, and to each thread's memory. */
    integer *job, *scratch;
};

static void pause_(void)
{
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

/* Do pieces until none is left. */
static void work(struct crew *crew, integer thread)
{
    for (;;) {
        integer piece = __atomic_fetch_add(&crew->next, 1, __ATOMIC_SEQ_CST);
        if (piece >= crew->pieces)
            return;
        if (!crew->chunks)
            crew->kernel(crew->job[piece], 0, 1, crew->scratch[piece], crew->verdict);
        else
            crew->kernel(crew->job[0], piece * crew->chunks / crew->pieces, (piece + 1) * crew->chunks / crew->pieces,
                         crew->scratch[thread], crew->verdict);
    }
}

/* Look out for jobs and help with them; returns when there has been none for some looks in a row. */
void mp2a_help(struct crew *crew, integer thread)
{
    for (integer look = 0; look < __atomic_load_n(&crew->looks, __ATOMIC_SEQ_CST); look++) {
        if (__atomic_load_n(&crew->open, __ATOMIC_SEQ_CST)) {
            /* First say so, then look again: a job is only changed when it is closed and nobody is active. */
            __atomic_fetch_add(&crew->active, 1, __ATOMIC_SEQ_CST);
            if (__atomic_load_n(&crew->open, __ATOMIC_SEQ_CST)
                && thread < crew->threads && __atomic_load_n(&crew->next, __ATOMIC_SEQ_CST) < crew->pieces) {
                work(crew, thread);
                look = 0;
            }
            __atomic_fetch_sub(&crew->active, 1, __ATOMIC_SEQ_CST);
        }
        pause_();
    }
}

/* Open the job that the crew describes, work on it, and return when it is done. */
void mp2a_lead(struct crew *crew)
{
    __atomic_store_n(&crew->next, 0, __ATOMIC_SEQ_CST);
    __atomic_store_n(&crew->open, 1, __ATOMIC_SEQ_CST);
    work(crew, 0);
    __atomic_store_n(&crew->open, 0, __ATOMIC_SEQ_CST);
    while (__atomic_load_n(&crew->active, __ATOMIC_SEQ_CST))
        pause_();
}
