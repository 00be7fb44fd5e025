// SPDX-License-Identifier: MIT
using System;
using System.Diagnostics;
using System.Threading;

namespace SplatBus.Tests
{
    /// <summary>A thread that waits hears all that it is told, also what is said in the middle of a wake.</summary>
    static class Wakes
    {
        const int LimitSeconds = 20, LongestPause = 100; // microseconds, longer than a thread takes to wake

        internal static int Run(int pairs)
        {
            var wait = new SocketWait();
            wait.WantNothing(0);
            wait.WantNothing(1);
            int told = 0, heard = 0;
            var sleeper = new Thread(() => { while (heard < 2 * pairs) { wait.For(60); Volatile.Write(ref heard, Volatile.Read(ref told)); } });
            sleeper.IsBackground = true;
            sleeper.Start();
            for (int pair = 0; pair < pairs; pair++)
            {
                Interlocked.Increment(ref told);
                wait.Wake();
                Stopwatch since = Stopwatch.StartNew();
                while (since.ElapsedTicks < pair % LongestPause * Stopwatch.Frequency / 1000000) { }
                Interlocked.Increment(ref told);
                wait.Wake();
                since.Restart();
                while (Volatile.Read(ref heard) < told)
                {
                    if (since.Elapsed.TotalSeconds > LimitSeconds) { Console.WriteLine("lost after {0}", told); return 1; }
                    Thread.Yield();
                }
            }
            Console.WriteLine("heard");
            return 0;
        }
    }
}
