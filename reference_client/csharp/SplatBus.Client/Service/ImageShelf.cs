// SPDX-License-Identifier: MIT
using System.Collections.Generic;
using System.IO;

namespace SplatBus
{
    /// <summary>
    /// The memory that is open, and the one image of it that is lent: it waits there, a reader holds it,
    /// or the reader has given it back. Whoever calls holds the client's lock.
    /// </summary>
    sealed class ImageShelf
    {
        enum Image { None, Waiting, Held, Read }

        /// <summary>Tickets of readers whose connection was lost meanwhile.</summary>
        readonly List<long> orphans = new List<long>();
        HostMemory current;
        /// <summary>Memory that is given up as soon as its reader is done [OPN-5].</summary>
        HostMemory leaving;
        Image image;
        long ticket;

        internal InitPacket Packet { get { return current == null ? null : current.Packet; } }

        internal bool HasWaiting { get { return image == Image.Waiting; } }

        /// <summary>Open what the session was told of, answer, and give up what was open before.</summary>
        /// <param name="why">Why it must not be opened, if it must not.</param>
        /// <returns>Why it cannot be opened, or null.</returns>
        internal string Open(IpcSession session, string why)
        {
            Settle(session);
            HostMemory fresh = null;
            if (session.Packet != null)
                try
                {
                    fresh = new HostMemory(session.Packet);
                    session.MemoryOpened();
                    why = null;
                }
                catch (IOException problem)
                {
                    why = problem.Message;
                    session.OpenFailed(why);
                }
            HostMemory former = current;
            current = fresh;
            if (former != null) GiveUp(former, session);
            return why;
        }

        /// <summary>An image is lent.</summary>
        internal void Put() { image = Image.Waiting; }

        internal FrameLease Take(Service client, IpcSession session)
        {
            if (image != Image.Waiting) return default(FrameLease);
            image = Image.Held;
            current.Hold();
            return new FrameLease(client, current, session.Frame, session.HasColor, session.HasDepth, ++ticket);
        }

        internal bool IsHeld(long which) { return image == Image.Held && which == ticket; }

        /// <summary>A reader is done; twice is as good as once.</summary>
        internal void GiveBack(long which, HostMemory memory)
        {
            bool isOrphan = orphans.Remove(which);
            if (!isOrphan && !IsHeld(which)) return;
            if (!isOrphan) image = Image.Read;
            memory.LetGo();
        }

        /// <summary>Say what readers have given back.</summary>
        internal void Settle(IpcSession session)
        {
            if (image != Image.Read) return;
            image = Image.None;
            session.Release();
            if (leaving == null) return;
            session.MemoryClosed(leaving.Packet.Generation);
            leaving = null;
        }

        /// <summary>The connection is gone, and with it all that it lent [CHN-18].</summary>
        internal void Clear()
        {
            if (image == Image.Held) orphans.Add(ticket);
            image = Image.None;
            leaving = null;
            if (current != null) current.LetGo();
            current = null;
        }

        void GiveUp(HostMemory former, IpcSession session)
        {
            if (image == Image.Waiting)
            {
                image = Image.None;
                session.Release();
            }
            former.LetGo();
            bool isRead = image == Image.Held && leaving == null;
            if (isRead) leaving = former;
            else session.MemoryClosed(former.Packet.Generation);
        }
    }
}
