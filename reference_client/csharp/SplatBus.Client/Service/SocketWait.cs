// SPDX-License-Identifier: MIT
using System;
using System.IO;
using System.Net;
using System.Net.Sockets;
using System.Runtime.InteropServices;
using System.Threading;

namespace SplatBus
{
    /// <summary>
    /// Waits for sockets, a time, or another thread. `Socket.Select` would leave 200 bytes of garbage
    /// each time, so this asks the system itself.
    /// </summary>
    sealed class SocketWait : IDisposable
    {
        const int Sockets = 3, WakerAt = 2;
        static readonly bool IsUnix = Path.DirectorySeparatorChar == '/';
        static readonly short Readable = (short)(IsUnix ? 0x1 : 0x300), Writable = (short)(IsUnix ? 0x4 : 0x10);

        struct UnixEntry
        {
            public int Socket;
            public short Wanted, Found;
        }

        struct WindowsEntry
        {
            public IntPtr Socket;
            public short Wanted, Found;
        }

        readonly UnixEntry[] unix = new UnixEntry[Sockets];
        readonly WindowsEntry[] windows = new WindowsEntry[Sockets];
        readonly Socket waker = new Socket(AddressFamily.InterNetwork, SocketType.Dgram, ProtocolType.Udp);
        readonly byte[] one = new byte[1];
        int isAwake;

        internal SocketWait()
        {
            waker.Bind(new IPEndPoint(IPAddress.Loopback, 0));
            waker.Connect(waker.LocalEndPoint);
            waker.Blocking = false;
            Want(WakerAt, waker.Handle, false);
        }

        /// <summary>Wait for this socket to be readable, and writable too if that is wanted.</summary>
        /// <param name="at">0 or 1: which of the two.</param>
        internal void Want(int at, IntPtr socket, bool writable)
        {
            short wanted = (short)(Readable | (writable ? Writable : 0));
            unix[at] = new UnixEntry { Socket = (int)socket, Wanted = wanted };
            windows[at] = new WindowsEntry { Socket = socket, Wanted = wanted };
        }

        /// <summary>Do not wait for a socket there.</summary>
        internal void WantNothing(int at)
        {
            unix[at] = new UnixEntry { Socket = -1 };
            windows[at] = new WindowsEntry { Socket = new IntPtr(-1) };
        }

        /// <summary>Return once something can be done, another thread has called <see cref="Wake"/>, or the time is over.</summary>
        internal void For(double seconds)
        {
            int milliseconds = (int)Math.Ceiling(1000 * Math.Max(0, Math.Min(seconds, 60)));
            if (IsUnix) poll(unix, (UIntPtr)Sockets, milliseconds);
            else WSAPoll(windows, Sockets, milliseconds);
            SocketError error;
            while (waker.Receive(one, 0, 1, SocketFlags.None, out error) > 0) { }
            Interlocked.Exchange(ref isAwake, 0); // not before: a wake between the two would be taken, and every later one lost
        }

        /// <summary>From any thread.</summary>
        internal void Wake()
        {
            SocketError error;
            if (Interlocked.Exchange(ref isAwake, 1) != 0) return;
            try { waker.Send(one, 0, 1, SocketFlags.None, out error); }
            catch (ObjectDisposedException) { } // nobody waits any more
        }

        public void Dispose() { waker.Close(); }

        [DllImport("libc", SetLastError = true)] static extern int poll([In, Out] UnixEntry[] entries, UIntPtr count, int milliseconds);
        [DllImport("ws2_32.dll")] static extern int WSAPoll([In, Out] WindowsEntry[] entries, uint count, int milliseconds);
    }
}
