// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.IO;
using System.Threading;
using System.Threading.Tasks;

namespace SplatBus
{
    /// <summary>The thread of a client: both channels, their sessions, and what crosses to the program's own threads.</summary>
    sealed class Service : IDisposable
    {
        const int Ipc = 0, Message = 1, MostEvents = 256;
        static readonly string[] Nothing = new string[0];
        const double Ever = double.PositiveInfinity, StopSeconds = 5;

        /// <summary>Whoever reads or changes anything here holds it.</summary>
        internal readonly object Gate = new object();
        readonly ClientOptions options;
        readonly Thread thread;
        readonly SocketWait wait = new SocketWait();
        readonly Queue<ClientEvent> events = new Queue<ClientEvent>();
        readonly Queue<Request> unsent = new Queue<Request>();
        internal readonly Wishes Wishes = new Wishes();
        readonly Json ipcJson = new Json(Limits.MaxServerValues), messageJson = new Json(Limits.MaxServerValues);
        readonly Channel ipc, message;
        readonly ImageShelf shelf = new ImageShelf();
        IpcSession ipcSession;
        MessageSession messageSession;
        bool wantsColor = true, wantsDepth = true, isIpcKnown, isStopping;
        string ipcLost, messageLost;
        /// <summary>By channel: what is wrong.</summary>
        readonly string[] problems = new string[2];

        internal Service(ClientOptions options)
        {
            this.options = options;
            ipc = new Channel(options.Host, options.IpcPort, IpcOpened, IpcReceived, IpcLost);
            message = new Channel(options.Host, options.MessagePort, MessageOpened, MessageReceived, MessageLost);
            thread = new Thread(Run) { IsBackground = true, Name = "SplatBus" };
            thread.Start();
        }

        internal static double Now { get { return Stopwatch.GetTimestamp() / (double)Stopwatch.Frequency; } }

        internal ClientStatus Status
        {
            get
            {
                lock (Gate)
                {
                    Welcome welcome = messageSession != null ? messageSession.Welcome : null;
                    Welcome either = welcome ?? (ipcSession != null ? ipcSession.Welcome : null);
                    return new ClientStatus
                    {
                        Ipc = ipcSession != null ? ipcSession.State : ChannelState.Away,
                        Message = messageSession != null ? messageSession.State : ChannelState.Away,
                        Server = either != null ? either.Server.Name + " " + either.Server.Version : null,
                        Capabilities = welcome != null ? welcome.Capabilities : Nothing,
                        Images = shelf.Packet,
                        Problem = problems[Ipc] ?? problems[Message],
                    };
                }
            }
        }

        /// <summary>Say what is wanted, at once where TCP takes it, so that no other thread has to wake; with the lock held.</summary>
        internal void Say()
        {
            if (messageSession == null) return;
            messageSession.SayWishes();
            if (!message.Offer(messageSession.Out)) wait.Wake();
        }

        internal void Subscribe(bool color, bool depth)
        {
            lock (Gate)
            {
                wantsColor = color;
                wantsDepth = depth;
            }
            wait.Wake();
        }

        internal FrameLease Take(TimeSpan limit)
        {
            double until = Now + limit.TotalSeconds;
            lock (Gate)
            {
                while (!shelf.HasWaiting && !isStopping)
                {
                    double left = until - Now;
                    if (left <= 0 || !Monitor.Wait(Gate, TimeSpan.FromSeconds(left))) break;
                }
                return shelf.Take(this, ipcSession);
            }
        }

        internal bool IsLent(long ticket) { lock (Gate) return shelf.IsHeld(ticket); }

        internal void GiveBack(long ticket, HostMemory memory)
        {
            lock (Gate)
            {
                shelf.GiveBack(ticket, memory);
                if (ipcSession == null) return;
                shelf.Settle(ipcSession);
                if (ipc.Offer(ipcSession.Out)) return;
            }
            wait.Wake();
        }

        internal bool TryTakeEvent(out ClientEvent taken)
        {
            lock (Gate)
            {
                taken = events.Count > 0 ? events.Dequeue() : null;
                return taken != null;
            }
        }

        internal Task<T> Ask<T>(Request<T> request)
        {
            request.Until = Now + Limits.ReplySeconds;
            lock (Gate)
            {
                if (isStopping) throw new ObjectDisposedException("SplatBusClient");
                unsent.Enqueue(request);
            }
            wait.Wake();
            return request.Task;
        }

        public void Dispose()
        {
            lock (Gate)
            {
                isStopping = true;
                Monitor.PulseAll(Gate);
            }
            wait.Wake();
            if (Thread.CurrentThread != thread) thread.Join(TimeSpan.FromSeconds(StopSeconds));
        }

        void Run()
        {
            while (true)
            {
                double until;
                lock (Gate)
                {
                    if (isStopping) break;
                    until = TurnOrEnd(Now);
                }
                wait.For(until - Now);
            }
            lock (Gate)
            {
                ipc.Close(Now, "the client ends");
                message.Close(Now, "the client ends");
                while (unsent.Count > 0) unsent.Dequeue().Fail(new ObjectDisposedException("SplatBusClient"));
                wait.Dispose();
            }
        }

        /// <summary>A defect of this client ends its connections, and never the program that it serves.</summary>
        double TurnOrEnd(double now)
        {
            try { return Turn(now); }
            catch (Exception defect)
            {
                ipc.Close(now, defect.ToString());
                message.Close(now, defect.ToString());
                return Math.Min(ipc.Due, message.Due);
            }
        }

        /// <summary>Do all that can be done now.</summary>
        /// <returns>When to do so again at the latest, in seconds.</returns>
        double Turn(double now)
        {
            ipc.Turn(now);
            message.Turn(now);
            ipc.Move(now, ipcSession == null ? null : ipcSession.Out);
            message.Move(now, messageSession == null ? null : messageSession.Out);
            if (ipcSession != null)
            {
                shelf.Settle(ipcSession);
                if (ipcSession.State == ChannelState.Agreed) ipcSession.Subscribe(wantsColor, wantsDepth);
                ipc.Send(now, ipcSession.Out);
            }
            if (messageSession != null) Speak(now);
            double asked = AskedUntil(now);
            ipc.Want(wait, Ipc, ipcSession != null && !ipcSession.Out.IsEmpty);
            message.Want(wait, Message, messageSession != null && !messageSession.Out.IsEmpty);
            return Math.Min(asked, Math.Min(ipc.Due, message.Due));
        }

        void Speak(double now)
        {
            if (now > messageSession.Deadline)
            {
                message.Close(now, "no reply within 10 seconds [CHN-15]");
                return;
            }
            messageSession.SayWishes();
            while (unsent.Count > 0 && messageSession.TryAsk(unsent.Peek(), now)) unsent.Dequeue();
            message.Send(now, messageSession.Out);
        }

        /// <summary>When the first wait for a reply ends; those that nobody could be asked in time end now.</summary>
        double AskedUntil(double now)
        {
            while (unsent.Count > 0 && unsent.Peek().Until < now) unsent.Dequeue().Fail(new TimeoutException("no server to ask within 10 seconds"));
            double first = unsent.Count > 0 ? unsent.Peek().Until : Ever;
            return Math.Min(first, messageSession == null ? Ever : messageSession.Deadline);
        }

        void IpcOpened()
        {
            ipcSession = new IpcSession(options, ipcJson);
            isIpcKnown = false;
            ipcLost = null;
        }

        void MessageOpened()
        {
            messageSession = new MessageSession(options, messageJson, Wishes, Now);
            messageLost = null;
        }

        string IpcReceived(ArraySegment<byte> payload)
        {
            IpcStep step = ipcSession.Receive(payload);
            string wrong = ipcSession.Problem;
            ipcSession.Problem = null;
            if (step == IpcStep.Close) return wrong;
            if (!isIpcKnown && ipcSession.State != ChannelState.Greeted)
            {
                isIpcKnown = true;
                ipc.Settled();
                Tell(new ConnectedEvent(ChannelName.Ipc, ipcSession.Welcome), null);
                bool isGranted = ipcSession.Welcome == null || ipcSession.Welcome.Capabilities.Length > 0;
                if (!isGranted) Tell(new ProblemEvent(ChannelName.Ipc, Negotiation.GrantsNothing), Negotiation.GrantsNothing);
            }
            if (step == IpcStep.Announced)
            {
                wrong = shelf.Open(ipcSession, wrong);
                Tell(new ImagesEvent(shelf.Packet, wrong), wrong);
            }
            else if (wrong != null) Tell(new ProblemEvent(ChannelName.Ipc, wrong), wrong);
            if (step == IpcStep.Error) OnError(ipc, ChannelName.Ipc, ipcSession.Error);
            if (step != IpcStep.Lent) return null;
            shelf.Put();
            Monitor.PulseAll(Gate);
            return null;
        }

        string MessageReceived(ArraySegment<byte> payload)
        {
            MessageStep step = messageSession.Receive(payload);
            string wrong = messageSession.Problem;
            messageSession.Problem = null;
            if (step == MessageStep.Close) return wrong;
            if (wrong != null) Tell(new ProblemEvent(ChannelName.Message, wrong), wrong);
            if (step == MessageStep.Agreed)
            {
                message.Settled();
                Tell(new ConnectedEvent(ChannelName.Message, messageSession.Welcome), null);
            }
            if (step == MessageStep.Telemetry) Tell(new TelemetryEvent(messageSession.Telemetry), null);
            if (step == MessageStep.Error) OnError(message, ChannelName.Message, messageSession.Error);
            return null;
        }

        void OnError(Channel channel, ChannelName name, Error error)
        {
            channel.Warned(Now, error.Code);
            Tell(new ErrorEvent(name, error), error.Code + ": " + error.Message);
        }

        void IpcLost(string why)
        {
            shelf.Clear();
            ipcSession = null;
            TellLost(ChannelName.Ipc, why, ref ipcLost);
        }

        void MessageLost(string why)
        {
            if (messageSession != null) messageSession.Lost(new IOException(why));
            messageSession = null;
            TellLost(ChannelName.Message, why, ref messageLost);
        }

        /// <summary>An attempt that fails as the one before did is nothing new.</summary>
        void TellLost(ChannelName channel, string why, ref string before)
        {
            if (why != before) Tell(new LostEvent(channel, why), why);
            before = why;
        }

        void Tell(ClientEvent told, string wrong)
        {
            bool isWell = told is ConnectedEvent || told is ImagesEvent;
            if (wrong != null || isWell) problems[(int)told.Channel] = wrong;
            if (events.Count == MostEvents) events.Dequeue();
            events.Enqueue(told);
        }
    }
}
