// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;

namespace SplatBus
{
    /// <summary>What a message on the IPC channel asks of who owns the connection.</summary>
    public enum IpcStep
    {
        Nothing,
        /// <summary>The server is known, see <see cref="IpcSession.State"/>.</summary>
        Agreed,
        /// <summary>Other memory: open <see cref="IpcSession.Packet"/> unless it is null, then give up what was open before [OPN-5].</summary>
        Announced,
        /// <summary><see cref="IpcSession.Frame"/> is lent, until <see cref="IpcSession.Release()"/>.</summary>
        Lent,
        /// <summary><see cref="IpcSession.Error"/> came.</summary>
        Error,
        /// <summary>Close the connection, for <see cref="IpcSession.Problem"/>.</summary>
        Close,
    }

    /// <summary>One connection to the IPC channel, without I/O: payloads in, steps and packets out.</summary>
    public sealed class IpcSession
    {
        const int MostBeforeWelcome = 16;
        static readonly string[] Capabilities = { Capability.HostShm, Capability.Frames, Capability.Reinit, Capability.Subscribe };

        struct Opened
        {
            public long Generation, Slots;
            public Meta Meta;
        }

        readonly Json json;
        readonly List<Opened> open = new List<Opened>();
        /// <summary>Generations that others replaced before anything could be answered.</summary>
        readonly List<long> passedOver = new List<long>();
        long newest, lastSeq = -1;
        string whyNot;
        bool wantsColor = true, wantsDepth = true, letColor = true, letDepth = true;

        /// <param name="json">Reads the payloads; no other session may use it at the time.</param>
        public IpcSession(ClientOptions options, Json json)
        {
            this.json = json;
            Negotiation.WriteHello(Out, options, Capabilities);
        }

        public readonly Outbox Out = new Outbox();
        /// <summary>The last one that was lent; it is used again.</summary>
        public readonly Frame Frame = Frames.Empty();
        public ChannelState State { get; private set; } = ChannelState.Greeted;
        public Welcome Welcome { get; private set; }
        /// <summary>The one that was announced last; null if it must not be opened.</summary>
        public InitPacket Packet { get; private set; }
        public Error Error { get; private set; }
        /// <summary>What the server last did wrong, or null; who reads it sets it to null.</summary>
        public string Problem { get; set; }
        /// <summary>Whether a frame is lent, and not released yet.</summary>
        public bool IsLent { get; private set; }
        /// <summary>Whether the frame that is lent has colour that may be read [IMG-22].</summary>
        public bool HasColor { get; private set; }
        /// <summary>Whether the frame that is lent has depth that may be read [IMG-22].</summary>
        public bool HasDepth { get; private set; }

        public IpcStep Receive(ArraySegment<byte> payload)
        {
            JsonValue message, type;
            try { message = json.Read(payload); }
            catch (ProtocolException broken)
            {
                Problem = broken.Message;
                return IpcStep.Nothing;
            }
            if (InitPackets.IsOne(message)) return OnInitPacket(message);
            if (!message.TryMember("type", out type)) return IpcStep.Nothing;
            if (type.Is("frame")) return OnFrame(message);
            if (type.Is("welcome")) return OnWelcome(message);
            if (!type.Is("error")) return IpcStep.Nothing;
            Error = Negotiation.ReadError(message);
            return IpcStep.Error;
        }

        /// <summary>The memory of <see cref="Packet"/> is mapped and checked [OPN-2].</summary>
        public void MemoryOpened()
        {
            open.Add(new Opened { Generation = Packet.Generation, Slots = Packet.Ring.Slots, Meta = Packet.Meta });
            letColor = wantsColor;
            letDepth = wantsDepth;
            Answer("opened", Packet.Generation);
        }

        /// <summary>The memory of <see cref="Packet"/> cannot be used.</summary>
        /// <param name="reason">1 to 1,024 characters [OPN-3].</param>
        public void OpenFailed(string reason)
        {
            Fail(Packet.Generation, reason);
            Packet = null;
        }

        /// <summary>The frame that was lent has been read [IMG-12, IMG-13].</summary>
        public void Release()
        {
            IsLent = false;
            Release(Frame.Generation, Frame.Seq);
        }

        /// <summary>The memory of this generation is unmapped, and what was lent of it released.</summary>
        public void MemoryClosed(long generation)
        {
            open.RemoveAll(each => each.Generation == generation);
            Answer("closed", generation);
        }

        /// <summary>What images shall hold from now on; said where it can be.</summary>
        public void Subscribe(bool color, bool depth)
        {
            if ((color == wantsColor && depth == wantsDepth) || !Negotiation.Lists(Welcome, Capability.Subscribe)) return;
            wantsColor = color;
            wantsDepth = depth;
            PacketWriter writer = Out.Begin("subscribe");
            writer.Name("channels");
            writer.BeginArray();
            if (color) writer.Text(SubscribeChannels.Color);
            if (depth) writer.Text(SubscribeChannels.Depth);
            writer.EndArray();
            Out.Add();
        }

        IpcStep OnWelcome(JsonValue message)
        {
            if (State != ChannelState.Greeted) return IpcStep.Nothing;
            Welcome welcome;
            try { welcome = Negotiation.ReadWelcome(message); }
            catch (ProtocolException broken)
            {
                Problem = "a welcome whose " + broken.Message;
                return IpcStep.Nothing;
            }
            if (welcome.Version == Negotiation.Former)
            {
                State = ChannelState.Old;
                return IpcStep.Agreed;
            }
            if (welcome.Version != Negotiation.Own) return Close("a welcome to a version that hello did not list [NEG-16]");
            State = ChannelState.Agreed;
            Welcome = welcome;
            foreach (long each in passedOver) Fail(each, "another init packet came before it could be opened");
            if (newest == 0) return IpcStep.Agreed;
            if (Packet == null) Fail(newest, whyNot);
            return IpcStep.Announced;
        }

        IpcStep OnInitPacket(JsonValue message)
        {
            JsonValue member;
            long generation = 0;
            if (State == ChannelState.Old) return IpcStep.Nothing;
            if (State == ChannelState.Greeted && !message.TryMember("version", out member))
            {
                State = ChannelState.Old;
                return IpcStep.Agreed;
            }
            bool named = message.TryMember("generation", out member) && member.TryInteger(out generation) && generation > newest;
            if (!named)
            {
                Problem = "an init packet without a generation that is greater than all before [MEM-1]";
                return IpcStep.Nothing;
            }
            bool further = newest > 0, early = State == ChannelState.Greeted;
            if (further && !early && !Negotiation.Lists(Welcome, Capability.Reinit)) return IpcStep.Nothing;
            if (further && early) passedOver.Add(newest);
            if (passedOver.Count > MostBeforeWelcome) return Close("too many init packets before welcome");
            newest = generation;
            try
            {
                Packet = InitPackets.Read(message);
                whyNot = Packet == null ? "an init packet without version [MEM-1]" : null;
            }
            catch (ProtocolException broken)
            {
                Packet = null;
                Problem = whyNot = broken.Message;
            }
            if (early) return IpcStep.Nothing;
            if (Packet == null) Fail(newest, whyNot);
            return IpcStep.Announced;
        }

        IpcStep OnFrame(JsonValue message)
        {
            long generation, seq, slot;
            if (!Negotiation.Lists(Welcome, Capability.Frames) || !Frames.ReadPlace(message, out generation, out seq, out slot)) return IpcStep.Nothing;
            int at = open.Count - 1;
            while (at >= 0 && open[at].Generation != generation) at--;
            if (at < 0 || slot >= open[at].Slots) return IpcStep.Nothing;
            string wrong = seq <= lastSeq ? "a frame whose seq is not greater than that of the one before [IMG-1]" : null;
            lastSeq = seq;
            if (IsLent) wrong = "a frame while another is lent [IMG-2]";
            // Memory that is given up is not read any more; a frame that crossed is released as it is.
            bool late = at < open.Count - 1 || generation != newest;
            if (!late && wrong == null) wrong = Frames.Read(message, open[at].Meta, Frame);
            if (wrong != null) Problem = wrong;
            if (late || wrong != null)
            {
                Release(generation, seq);
                return IpcStep.Nothing;
            }
            Frame.Generation = generation;
            Frame.Seq = seq;
            Frame.Slot = slot;
            HasColor = letColor;
            HasDepth = letDepth;
            IsLent = true;
            return IpcStep.Lent;
        }

        IpcStep Close(string why)
        {
            Problem = why;
            return IpcStep.Close;
        }

        void Release(long generation, long seq)
        {
            letColor = wantsColor;
            letDepth = wantsDepth;
            PacketWriter writer = Out.Begin("release");
            writer.Member("generation", generation);
            writer.Member("seq", seq);
            Out.Add();
        }

        void Fail(long generation, string reason)
        {
            PacketWriter writer = Out.Begin("open_failed");
            writer.Member("generation", generation);
            writer.Member("reason", reason.Length > 1000 ? reason.Substring(0, 999) : reason);
            Out.Add();
        }

        void Answer(string type, long generation)
        {
            PacketWriter writer = Out.Begin(type);
            writer.Member("generation", generation);
            Out.Add();
        }
    }
}
