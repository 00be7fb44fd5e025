// SPDX-License-Identifier: MIT
using System;
using System.IO;
using System.IO.MemoryMappedFiles;
using System.Runtime.InteropServices;

namespace SplatBus
{
    /// <summary>Named memory of the host, mapped for reading only [MEM-19, OPN-10]; unmapped when the last who holds it lets go.</summary>
    sealed class HostMemory
    {
        readonly MemoryMappedFile file;
        readonly MemoryMappedViewAccessor view;
        readonly long length;
        IntPtr start;
        int holders = 1;

        internal readonly InitPacket Packet;

        /// <param name="packet">A packet that was checked whole, with memory of the host.</param>
        /// <exception cref="IOException">There is no such memory, it is shorter than announced [MEM-6], or not to be read.</exception>
        internal HostMemory(InitPacket packet)
        {
            Packet = packet;
            string name = ((HostShmMemory)packet.Memory).Name;
            length = packet.Memory.Bytes;
            if (Path.DirectorySeparatorChar == '/')
            {
                start = Unix.Map(name, length);
                return;
            }
            try
            {
                file = MemoryMappedFile.OpenExisting("Local\\" + name, MemoryMappedFileRights.Read);
                view = file.CreateViewAccessor(0, length, MemoryMappedFileAccess.Read);
                start = view.SafeMemoryMappedViewHandle.DangerousGetHandle();
            }
            catch (SystemException problem)
            {
                if (file != null) file.Dispose();
                throw new IOException("no shared memory of " + length + " bytes: " + problem.Message + " [MEM-6]");
            }
        }

        internal IntPtr At(long offset) { return new IntPtr(start.ToInt64() + offset); }

        internal void Hold() { holders++; }

        /// <summary>Not to be called by two threads at a time.</summary>
        internal void LetGo()
        {
            if (--holders > 0) return;
            if (view == null) Unix.Unmap(start, length);
            else
            {
                view.Dispose();
                file.Dispose();
            }
            start = IntPtr.Zero;
        }

        /// <summary>shm_open and mmap: a mapping of the framework would hold the memory by a descriptor, and follow a link.</summary>
        static class Unix
        {
            const int NoEntry = 2, NoAccess = 13;
            const int ReadOnly = 0, NonBlocking = 0x800, ProtectionRead = 1, Shared = 1, FromEnd = 2;

            [DllImport("libc", SetLastError = true)] static extern int open(string path, int flags);
            [DllImport("libc", SetLastError = true)] static extern int shm_open(string name, int flags, uint mode);
            [DllImport("libc", SetLastError = true)] static extern long lseek(int file, long offset, int whence);
            [DllImport("libc", SetLastError = true)] static extern IntPtr mmap(IntPtr wanted, UIntPtr length, int protection, int flags, int file, long offset);
            [DllImport("libc")] static extern int munmap(IntPtr start, UIntPtr length);
            [DllImport("libc")] static extern int close(int file);

            internal static IntPtr Map(string name, long length)
            {
                int file = Open(name);
                try
                {
                    long real = lseek(file, 0, FromEnd);
                    if (real < length) throw new IOException("memory is " + real + " bytes long, " + length + " were announced [MEM-6]");
                    IntPtr start = mmap(IntPtr.Zero, new UIntPtr((ulong)length), ProtectionRead, Shared, file, 0);
                    if (start.ToInt64() == -1) throw new IOException("mmap failed with error " + Marshal.GetLastWin32Error());
                    return start;
                }
                finally { close(file); }
            }

            static int Open(string name)
            {
                const string folder = "/dev/shm/"; // what shm_open means on Linux; it is in libc only since glibc 2.34
                string path = folder + name;
                bool isLinux = Directory.Exists(folder);
                if (isLinux && File.Exists(path) && (File.GetAttributes(path) & FileAttributes.ReparsePoint) != 0)
                    throw new IOException("the name is that of a link [SEC-2]");
                int file = isLinux ? open(path, ReadOnly | NonBlocking) : shm_open("/" + name, ReadOnly, 0);
                if (file < 0)
                {
                    int error = Marshal.GetLastWin32Error();
                    string why = error == NoEntry ? "there is no shared memory " + name + ": client and server have to be on one machine; in containers, with --ipc=host or one /dev/shm"
                        : error == NoAccess ? "shared memory " + name + " is another user's: client and server have to be one user's"
                        : "shared memory " + name + ": error " + error;
                    throw new IOException(why);
                }
                return file;
            }

            internal static void Unmap(IntPtr start, long length) { munmap(start, new UIntPtr((ulong)length)); }
        }
    }
}
