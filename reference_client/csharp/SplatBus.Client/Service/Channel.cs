// SPDX-License-Identifier: MIT
using System;
using System.Net;
using System.Net.Sockets;
using System.Threading.Tasks;

namespace SplatBus
{
    /// <summary>
    /// The socket of one channel: connects, and again when it is lost; bytes between it and a session,
    /// within the limits of time (1.0 chapter 3). All on one thread, and never blocking it but for names.
    /// </summary>
    sealed class Channel
    {
        const double ConnectSeconds = 5, FirstPause = Limits.ReconnectMinSeconds, LongestPause = 3, RefusedPause = 4, LookAgain = 0.05;
        const int ReadsATurn = 16;

        readonly string host;
        readonly int port;
        /// <summary>Called when a connection stands.</summary>
        readonly Action opened;
        /// <summary>Called with each payload; returns why the connection has to be closed, or null.</summary>
        readonly Func<ArraySegment<byte>, string> received;
        /// <summary>Called with why, when an attempt has failed or a connection is gone.</summary>
        readonly Action<string> lost;

        Socket socket;
        PacketReader reader;
        IPAddress[] addresses = new IPAddress[0];
        Task<IPAddress[]> lookup;
        int next;
        bool isConnecting;
        /// <summary>Seconds: when to try again; when to give up connecting; when a packet has to be whole.</summary>
        double again, connected, whole = double.PositiveInfinity;
        double began = double.NegativeInfinity, pause = FirstPause;

        internal Channel(string host, int port, Action opened, Func<ArraySegment<byte>, string> received, Action<string> lost)
        {
            this.host = host;
            this.port = port;
            this.opened = opened;
            this.received = received;
            this.lost = lost;
        }

        internal bool IsOpen { get { return socket != null && !isConnecting; } }

        /// <summary>When something has to be done at the latest.</summary>
        internal double Due { get { return socket == null ? again : isConnecting ? connected : whole; } }

        /// <summary>The server is one: the next attempt may come soon after this connection.</summary>
        internal void Settled() { pause = FirstPause; }

        /// <summary>An error came: do not come back at once [NEG-24]; later, if the server will not have us.</summary>
        internal void Warned(double now, string code)
        {
            bool refused = code == ErrorCode.Unauthorized || code == ErrorCode.UnsupportedVersion || code == ErrorCode.TooManyClients;
            pause = Math.Max(pause, refused ? RefusedPause : Limits.ErrorPauseSeconds);
            began = Math.Max(began, now); // no sooner than 0.1 s from now
        }

        /// <summary>Do what time asks for.</summary>
        internal void Turn(double now)
        {
            if (now < Due) return;
            if (socket == null) Connect(now);
            else if (isConnecting) Close(now, "no answer within 5 seconds");
            else Close(now, "a packet was not whole after 10 seconds [FRM-5]");
        }

        internal void Want(SocketWait wait, int at, bool hasMore)
        {
            if (socket == null) wait.WantNothing(at);
            else wait.Want(at, socket.Handle, isConnecting || hasMore);
        }

        /// <summary>Take what TCP has, and give it what it takes.</summary>
        internal void Move(double now, Outbox outbox)
        {
            if (socket == null) return;
            if (isConnecting && !HasConnected(now)) return;
            if (outbox != null) Send(now, outbox);
            for (int i = 0; i < ReadsATurn && socket != null; i++) if (!Receive(now)) return;
        }

        /// <summary>
        /// Give TCP what it takes now, from any thread that holds the lock; whether that was all. What
        /// went wrong the client's own thread finds, which alone closes.
        /// </summary>
        internal bool Offer(Outbox outbox)
        {
            if (!IsOpen || outbox.IsEmpty) return outbox.IsEmpty;
            ArraySegment<byte> waiting = outbox.Waiting;
            SocketError error;
            int sent = socket.Send(waiting.Array, waiting.Offset, waiting.Count, SocketFlags.None, out error);
            if (error == SocketError.Success) outbox.Taken(sent);
            return outbox.IsEmpty;
        }

        internal void Send(double now, Outbox outbox)
        {
            while (IsOpen && !outbox.IsEmpty)
            {
                ArraySegment<byte> waiting = outbox.Waiting;
                SocketError error;
                int sent = socket.Send(waiting.Array, waiting.Offset, waiting.Count, SocketFlags.None, out error);
                if (error == SocketError.WouldBlock) return;
                if (error == SocketError.Success) outbox.Taken(sent);
                else Close(now, "the connection was lost: " + error);
            }
        }

        internal void Close(double now, string why)
        {
            if (socket == null) return;
            socket.Close();
            socket = null;
            isConnecting = false;
            whole = double.PositiveInfinity;
            again = Math.Max(now + pause, began + FirstPause);
            pause = Math.Min(2 * pause, LongestPause);
            lost(why);
        }

        void Connect(double now)
        {
            if (next >= addresses.Length && !HasAddresses(now)) return;
            began = now;
            connected = now + ConnectSeconds;
            IPAddress address = addresses[next++];
            socket = new Socket(address.AddressFamily, SocketType.Stream, ProtocolType.Tcp) { NoDelay = true, Blocking = false };
            isConnecting = true;
            try { socket.Connect(new IPEndPoint(address, port)); }
            catch (SocketException problem)
            {
                if (problem.SocketErrorCode != SocketError.WouldBlock && problem.SocketErrorCode != SocketError.InProgress) Close(now, problem.Message);
            }
        }

        /// <summary>Look the name up, anew each time that all of its addresses have been tried; ask again soon while that takes.</summary>
        bool HasAddresses(double now)
        {
            IPAddress address;
            next = 0;
            if (IPAddress.TryParse(host, out address)) addresses = new[] { address };
            else
            {
                if (lookup == null) lookup = Dns.GetHostAddressesAsync(host);
                again = now + LookAgain;
                if (!lookup.IsCompleted) return false;
                Task<IPAddress[]> found = lookup;
                lookup = null;
                again = now + LongestPause;
                addresses = found.Status == TaskStatus.RanToCompletion ? found.Result : new IPAddress[0];
                if (addresses.Length == 0) lost("no address is known of '" + host + "'");
            }
            return addresses.Length > 0;
        }

        bool HasConnected(double now)
        {
            if (!socket.Poll(0, SelectMode.SelectWrite) && !socket.Poll(0, SelectMode.SelectError)) return false;
            var error = (SocketError)(int)socket.GetSocketOption(SocketOptionLevel.Socket, SocketOptionName.Error);
            if (error != SocketError.Success)
            {
                Close(now, "no connection: " + error);
                return false;
            }
            isConnecting = false;
            reader = new PacketReader();
            opened();
            return true;
        }

        /// <summary>Whether there may be more.</summary>
        bool Receive(double now)
        {
            SocketError error;
            ArraySegment<byte> room = reader.Room(), payload;
            int count = socket.Receive(room.Array, room.Offset, room.Count, SocketFlags.None, out error);
            if (error == SocketError.WouldBlock) return false;
            if (error != SocketError.Success || count == 0)
            {
                Close(now, count == 0 && error == SocketError.Success ? "the server has closed the connection" : "the connection was lost: " + error);
                return false;
            }
            reader.Received(count);
            try
            {
                bool any = false;
                while (reader.Next(out payload))
                {
                    any = true;
                    string why = received(payload);
                    if (why == null) continue;
                    Close(now, why);
                    return false;
                }
                if (reader.IsBetweenPackets) whole = double.PositiveInfinity;
                else if (any || double.IsInfinity(whole)) whole = now + Limits.PacketCompletionSeconds;
            }
            catch (ProtocolException broken)
            {
                Close(now, broken.Message);
                return false;
            }
            return count == room.Count;
        }
    }
}
