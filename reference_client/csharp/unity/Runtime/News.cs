// SPDX-License-Identifier: MIT
namespace SplatBus.Unity
{
    using System;
    using System.Collections.Generic;
    using UnityEngine;
    using Object = UnityEngine.Object;

    /// <summary>What the client's events were about.</summary>
    [Flags]
    enum NewsKind
    {
        None = 0,
        /// <summary>Other memory for images is open, or none any more.</summary>
        Images = 1,
        /// <summary>The connection that lent images is gone, and what it lent.</summary>
        Lost = 2,
        /// <summary>There is a server that may be asked.</summary>
        Asked = 4,
    }

    /// <summary>Takes the client's events, logs what is new of them, and keeps what is wrong.</summary>
    sealed class News
    {
        static readonly string[] Channels = { "images", "messages" };
        /// <summary>By channel: why there is no connection; what the server said; what it did wrong.</summary>
        readonly string[] lost = new string[2], said = new string[2], broken = new string[2];
        string[] capabilities;
        string noImages;
        bool isBusy;

        /// <summary>The memory that is open, or null.</summary>
        internal InitPacket Images { get; private set; }
        /// <summary>Whether it is known what the server has on the message channel.</summary>
        internal bool IsKnown { get { return capabilities != null; } }

        internal bool Has(string capability) { return capabilities != null && Array.IndexOf(capabilities, capability) >= 0; }

        internal void Forget()
        {
            Array.Clear(lost, 0, 2);
            Array.Clear(said, 0, 2);
            Array.Clear(broken, 0, 2);
            capabilities = null;
            noImages = null;
            Images = null;
            isBusy = false;
        }

        /// <summary>The images show the pose that was sent: nobody else steers.</summary>
        internal void IsFollowed()
        {
            if (!isBusy) return;
            isBusy = false;
            said[(int)ChannelName.Message] = null;
        }

        internal NewsKind Take(SplatBusClient client, Object of)
        {
            NewsKind heard = NewsKind.None;
            ClientEvent told;
            while (client.TryTakeEvent(out told)) heard |= Hear(told, of);
            return heard;
        }

        internal void ListProblems(List<string> to)
        {
            for (int i = 0; i < 2; i++)
            {
                if (lost[i] != null) to.Add(Channels[i] + ": " + lost[i]);
                if (said[i] != null) to.Add(Channels[i] + ": the server says " + said[i]);
                if (broken[i] != null) to.Add(Channels[i] + ": the server broke a rule: " + broken[i]);
            }
            if (noImages != null) to.Add("no images: " + noImages);
        }

        NewsKind Hear(ClientEvent told, Object of)
        {
            int at = (int)told.Channel;
            var connected = told as ConnectedEvent;
            var gone = told as LostEvent;
            var images = told as ImagesEvent;
            var error = told as ErrorEvent;
            var problem = told as ProblemEvent;
            if (connected != null) return Connected(at, connected.Welcome, of);
            if (gone != null) return Lost(at, gone.Why, of);
            if (images != null) return ImagesCame(images, of);
            if (error != null)
            {
                isBusy |= error.Error.Code == ErrorCode.Busy && at == (int)ChannelName.Message;
                Keep(ref said[at], error.Error.Code + ": " + error.Error.Message, at, of);
            }
            if (problem != null) Keep(ref broken[at], problem.What, at, of);
            return NewsKind.None;
        }

        NewsKind Connected(int at, Welcome welcome, Object of)
        {
            lost[at] = said[at] = broken[at] = null;
            Debug.Log("SplatBus, " + Channels[at] + ": " + (welcome == null ? "a server of 1.0" : welcome.Server.Name + " " + welcome.Server.Version), of);
            if (at == (int)ChannelName.Ipc) return NewsKind.None;
            capabilities = welcome == null ? new string[0] : welcome.Capabilities;
            isBusy = false;
            return NewsKind.Asked;
        }

        NewsKind Lost(int at, string why, Object of)
        {
            Keep(ref lost[at], why, at, of);
            if (at == (int)ChannelName.Message)
            {
                capabilities = null;
                return NewsKind.None;
            }
            Images = null;
            noImages = null;
            return NewsKind.Images | NewsKind.Lost;
        }

        NewsKind ImagesCame(ImagesEvent images, Object of)
        {
            Images = images.Packet;
            if (Images == null) Keep(ref noImages, images.Why ?? "the server has none yet", (int)ChannelName.Ipc, of);
            else noImages = null;
            return NewsKind.Images;
        }

        /// <summary>Log it, unless it is what was there.</summary>
        static void Keep(ref string place, string what, int at, Object of)
        {
            if (place != what) Debug.LogWarning("SplatBus, " + Channels[at] + ": " + what, of);
            place = what;
        }
    }
}
